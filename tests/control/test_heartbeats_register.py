"""What the heartbeat's register tells of PLCs and gateways with manners of their own."""

import pytest

from igrow.edge.bus.errors import NoAnswerError
from igrow.edge.bus.plc import Reading
from igrow.edge.guard.heartbeat import END_READINGS, HABIT, HABIT_BEATS, HEARTBEAT, LATE_BEATS, BeatCount
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import SAFE, make_stubborn_bench

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def bench_of(**more):
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


def beaten(count, times=1):
    for _ in range(times):
        count.next()
        count.arrived()
    return count


def kept(start=0.0):
    """A count in whose register its number was seen."""
    count = BeatCount()
    count.was_cleared(start)
    beaten(count)
    assert not count.was_cleared(start + 1.0)
    return count


def test_a_gateway_that_answers_out_of_its_memory_clears_nothing_and_is_no_second_gateway():
    count = kept()
    for number in range(2, 40):
        beaten(count)
        assert not count.was_cleared(max(1.0, number - 3.0))
        assert not count.problem


def test_a_number_before_the_one_that_was_shown_last_is_a_start():
    count = kept()
    for number in range(2, 8):
        beaten(count)
        assert not count.was_cleared(number)
    assert count.was_cleared(4.0)


def test_what_a_plc_has_kept_comes_back_after_zeros_and_is_the_same_start():
    count = beaten(kept(100.0))
    assert count.was_cleared(0.0)
    beaten(count)
    assert count.was_cleared(60.0)
    beaten(count)
    assert not count.was_cleared(60.0)


def test_a_register_that_is_cleared_again_and_again_with_nothing_else_is_watched_so():
    count, told = kept(), []
    for _ in range(HABIT + 3):
        beaten(count)
        assert not count.was_cleared(count._beat)
        beaten(count)
        told.append(count.was_cleared(0.0))
    assert told == [True] * HABIT + [False] * 3
    again = BeatCount()
    again.recall(count.note())
    beaten(again)
    assert not again.was_cleared(1.0)
    assert not again.was_cleared(0.0)


@pytest.mark.parametrize("way", ["a start", "long ago"])
def test_the_habit_ends(way):
    count = kept()
    for _ in range(HABIT):
        beaten(count)
        assert count.was_cleared(0.0)
        beaten(count)
        assert not count.was_cleared(count._beat)
    if way == "a start":
        count.meant_a_start(seen=True)
    else:
        for _ in range(HABIT_BEATS + 1):
            beaten(count)
            assert not count.was_cleared(count._beat)
    beaten(count)
    assert count.was_cleared(0.0)


def test_a_register_that_ends_before_its_type_does_is_counted_to_its_end():
    count, shown, numbers = BeatCount(), 32_760.0, []
    for _ in range(40):
        count.was_cleared(shown)
        number = count.next()
        count.arrived()
        shown = float(min(number, 32_767))
        numbers.append(shown)
    assert not count.problem
    assert 1.0 in numbers
    assert numbers[-1] < 32_760.0


def test_a_register_that_ended_in_a_silence_was_not_cleared():
    count = BeatCount()
    count.was_cleared(32_750.0)
    beaten(count)
    assert not count.was_cleared(32_751.0)
    beaten(count, 3 * LATE_BEATS)
    assert not count.was_cleared(32_767.0)
    for _ in range(END_READINGS + 2):
        beaten(count)
        shown = min(count._beat, 32_767)
        assert not count.was_cleared(shown)
    assert shown == 2
    assert not count.problem


def test_a_register_that_ends_there_shows_its_end_after_a_start_and_that_is_no_other_start():
    before = beaten(kept(32_760.0), 3)
    assert not before.was_cleared(before._beat)
    count = BeatCount()
    count.recall(before.note())
    count.was_cleared(32_767.0)
    beaten(count, 4)
    assert not count.was_cleared(32_767.0)
    beaten(count)
    assert count.was_cleared(0.0)
    beaten(count)
    assert not count.was_cleared(32_767.0)


@pytest.mark.parametrize("most", [127, 255, 32_767])
def test_a_register_that_keeps_only_the_low_bits_is_counted_to_their_end(most):
    count, starts = BeatCount(), 0
    count.was_cleared(most - 5.0)
    for _ in range(600):
        beaten(count)
        starts += count.was_cleared(count._beat & most)
        assert not count.problem
    assert starts == 1, "the first zero alone"
    assert count._beat <= most


def test_another_gateways_numbers_are_none_of_ours():
    count = kept(5000.0)
    for number in range(100, 120):
        beaten(count)
        count.was_cleared(number)
    assert "another gateway" in count.problem


async def test_a_gateway_that_answers_for_a_plc_that_is_gone_is_told_and_the_fallback_is_no_hand():
    bench = bench_of()
    await bench.run(5)
    behind, gone = dict(bench.plc.values), True
    write = bench.plc.write

    async def into_nothing(name, value):
        if not gone:
            await write(name, value)

    bench.plc.write = into_nothing
    await bench.run(LATE_BEATS + 3)
    assert "answer for a PLC" in bench.alarms["heartbeat register"]
    gone = False
    bench.plc.values |= behind | SAFE | {HEARTBEAT: bench.plc.values[HEARTBEAT]}
    await bench.run(10)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH
    assert "heartbeat register" not in bench.alarms


async def test_a_hand_in_the_moment_in_which_a_plc_clears_the_register_by_habit_is_a_hand():
    bench = bench_of()
    for _ in range(HABIT + 1):
        await bench.run(6)
        bench.plc.values[HEARTBEAT] = 0.0
    await bench.run(6)
    bench.plc.values[HEARTBEAT] = 0.0
    bench.plc.by_hand("heating_setpoint", 24.0)
    await bench.run(3)
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [24.0]
    assert bench.plc.values["heating_setpoint"] == 24.0


async def test_no_beat_wipes_out_a_register_that_was_not_read_since_its_plc_was_interrupted():
    bench = bench_of()
    await bench.run(5)
    bench.plc.silent = True
    await bench.run(1)
    bench.plc.silent = False
    bench.plc.values |= {"heating_setpoint": 15.0, "co2_setpoint": 500.0, "lamp_on": 0.25, HEARTBEAT: 1.0}
    usual = bench.plc._reading

    def in_part(name, now):
        lost = name in {HEARTBEAT, *WISH}
        return Reading(None, NoAnswerError("no answer"), now) if lost else usual(name, now)

    bench.plc._reading = in_part
    beats = len(bench.plc.written(HEARTBEAT))
    await bench.run(2)
    assert len(bench.plc.written(HEARTBEAT)) == beats
    bench.plc._reading = usual
    await bench.run(4)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_the_heart_beats_on_where_its_register_cannot_be_read_any_more():
    bench = bench_of()
    await bench.run(5)
    bench.plc.unreadable = {HEARTBEAT}
    beats = len(bench.plc.written(HEARTBEAT))
    await bench.run(20)
    assert len(bench.plc.written(HEARTBEAT)) >= beats + 18
