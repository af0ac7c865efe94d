"""A PLC that starts anew, or falls back, of which a reading shows one half before and the other half after it."""

from collections.abc import Callable, Collection

import pytest

from igrow.edge.bus.errors import NoAnswerError, UnitRestingError
from igrow.edge.bus.plc import Reading
from igrow.edge.guard.heartbeat import HEARTBEAT, BeatCount
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import SAFE, StubbornBench, make_stubborn_bench

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
OUTSIDE = {"heating_setpoint": 10.5, "co2_setpoint": 360.0, "lamp_on": 0.0, "irrigation_on": 0.0}
INSIDE = {"heating_setpoint": 16.0, "co2_setpoint": 500.0, "lamp_on": 0.25, "irrigation_on": 0.25}
"""What no limit tells from a hand."""
TWO_UNITS = {
    "air_temperature": "climate", "heating_setpoint": "climate", "co2_setpoint": "climate", "heartbeat": "climate",
    "wind_speed": "weather", "air_co2": "weather", "lamp_on": "weather", "irrigation_on": "weather",
}  # fmt: skip


def bench_of(**more):
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


def tear(bench: StubbornBench, before: Collection[str], happens: Callable[[], None]) -> None:
    """In the middle of the next sweep something happens: these points are read before it, the others after it."""
    read, pending = bench.plc.read, [happens]

    async def torn(names=None):
        if not pending:
            return await read(names)
        first = {name for name in bench.plc.values if name in before}
        readings = dict(await read(first))
        pending.pop()()
        return readings | dict(await read(bench.plc.values.keys() - first))

    bench.plc.read = torn


def lose(bench: StubbornBench, *names: str) -> Callable[[], None]:
    """Requests for these points get no answer, until what is returned is called."""
    read = bench.plc.read

    async def lossy(asked=None):
        readings, now = dict(await read(asked)), bench.clock.monotonic()
        return readings | {n: Reading(None, NoAnswerError("lost"), now) for n in readings.keys() & set(names)}

    def end() -> None:
        bench.plc.read = read

    bench.plc.read = lossy
    return end


HALVES: list[tuple[str, ...]] = [
    ("heating_setpoint",), ("heartbeat",), ("heating_setpoint", "heartbeat"), ("co2_setpoint", "lamp_on", "heartbeat"),
    ("heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on"),
    ("irrigation_on", "heartbeat", "heating_setpoint"),
]  # fmt: skip


@pytest.mark.parametrize("before", HALVES)
@pytest.mark.parametrize("defaults", [OUTSIDE, INSIDE])
async def test_a_plc_that_starts_anew_in_the_middle_of_a_reading_is_no_hand(before, defaults):
    bench = bench_of()
    await bench.run(5)
    tear(bench, before, lambda: bench.plc.power_up(defaults))
    await bench.run(4)
    assert not bench.events("changed_by_hand")
    assert {event["point"] for event in bench.events("plc_restarted")} == WISH.keys()
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_it_is_told_by_the_setpoints_alone_where_there_is_no_heartbeat():
    bench = bench_of(heartbeat=False)
    await bench.run(5)
    tear(bench, ["heating_setpoint"], lambda: bench.plc.power_up(OUTSIDE, heartbeat=False))
    await bench.run(4)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_hand_in_the_middle_of_a_reading_is_a_hand_and_found_in_the_same_cycle():
    bench = bench_of()
    await bench.run(5)
    tear(bench, ["heating_setpoint", "heartbeat"], lambda: bench.plc.by_hand("co2_setpoint", 500.0))
    await bench.run(1)
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["co2_setpoint"]
    await bench.run(3)
    assert bench.plc.values["co2_setpoint"] == 500.0


async def test_a_hand_after_a_start_that_kept_the_setpoints_is_a_hand():
    """Only the heartbeat's register was cleared; all was looked at once more after that."""
    bench = bench_of()
    await bench.run(5)
    tear(bench, list(WISH), lambda: bench.plc.power_up({}))
    await bench.run(2)
    bench.plc.by_hand("heating_setpoint", 16.0)
    await bench.run(3)
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]
    assert bench.plc.values["heating_setpoint"] == 16.0


async def test_a_hand_after_a_start_that_was_seen_is_a_hand_though_the_second_look_was_lost():
    bench = bench_of()
    await bench.run(5)
    bench.plc.power_up(OUTSIDE)
    read = bench.plc.read

    async def only_whole_sweeps(names=None):
        readings, now = dict(await read(names)), bench.clock.monotonic()
        return readings if names is None else {n: Reading(None, NoAnswerError("lost"), now) for n in readings}

    bench.plc.read = only_whole_sweeps
    bench.plc.write_error = UnitRestingError("rests")
    await bench.run(1)
    bench.plc.read, bench.plc.write_error = read, None
    bench.plc.by_hand("heating_setpoint", 16.0)
    await bench.run(3)
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]
    assert bench.plc.values["heating_setpoint"] == 16.0


@pytest.mark.parametrize("heartbeat", [True, False])
async def test_a_start_of_which_a_lossy_line_has_shown_one_half_earlier_is_no_hand(heartbeat):
    """One half was not read for long, so a hand would have had the time; but the line lost something meanwhile."""
    bench = bench_of(heartbeat=heartbeat)
    await bench.run(5)
    end = lose(bench, "heating_setpoint", HEARTBEAT)
    await bench.run(6)
    end()
    end = lose(bench, *WISH, HEARTBEAT)
    bench.plc.power_up(OUTSIDE, heartbeat=heartbeat)
    await bench.run(1)
    end()
    await bench.run(3)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_hand_that_was_seen_before_the_start_and_the_start_are_judged_apart_or_not_at_all():
    """The half that was read held a hand's value; then the PLC started anew, and the other half was read."""
    bench = bench_of()
    await bench.run(5)
    end = lose(bench, "co2_setpoint", "lamp_on", "irrigation_on", HEARTBEAT)
    bench.plc.by_hand("heating_setpoint", 16.0)
    await bench.run(2)
    end()
    end = lose(bench, "heating_setpoint")
    bench.plc.power_up(OUTSIDE, heartbeat=False)
    await bench.run(2)
    end()
    await bench.run(3)
    assert {event["shown"] for event in bench.events("changed_by_hand")} <= {16.0}
    assert {name: bench.plc.values[name] for name in WISH if name != "heating_setpoint"} == {
        name: wish for name, wish in WISH.items() if name != "heating_setpoint"
    }


@pytest.mark.parametrize("unit", ["climate", "weather"])
async def test_a_start_of_one_unit_in_the_middle_of_a_reading_leaves_a_hand_at_the_other_one(unit):
    bench = bench_of(units=TWO_UNITS)
    await bench.run(5)
    here = [name for name in WISH if TWO_UNITS[name] == unit]
    (hand,) = [name for name in ("co2_setpoint", "irrigation_on") if TWO_UNITS[name] != unit]
    zeros = dict.fromkeys(here, -1.0)

    def both() -> None:
        bench.plc.power_up(zeros, heartbeat=unit == "climate")
        bench.plc.by_hand(hand, INSIDE[hand])

    tear(bench, here[:1], both)
    await bench.run(5)
    assert [event["point"] for event in bench.events("changed_by_hand")] == [hand]
    assert {name: bench.plc.values[name] for name in WISH} == WISH | {hand: INSIDE[hand]}


@pytest.mark.parametrize("agreed_in_new_process", [0, 1])
async def test_a_plc_and_a_daemon_that_start_anew_together_are_no_hand(agreed_in_new_process):
    """No limit tells these defaults from a hand; but the process before knew a register that keeps its number."""
    bench = bench_of()
    await bench.run(5)
    bench.pass_time(20.0)
    bench.restart()
    if agreed_in_new_process:
        end = lose(bench, *WISH)
        await bench.run(agreed_in_new_process)
        end()
    bench.plc.power_up(INSIDE)
    await bench.run(3)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_hand_while_no_daemon_was_there_is_a_hand_where_the_heartbeat_stands():
    bench = bench_of()
    await bench.run(5)
    bench.restart()
    bench.plc.by_hand("heating_setpoint", 16.0)
    bench.pass_time(20.0)
    await bench.run(3)
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]


async def test_a_reload_forgets_neither_the_number_nor_when_it_was_heard():
    bench = bench_of()
    await bench.run(5)
    before, bench.cycle = bench.cycle, bench.build()
    bench.cycle.carry_over(before, [*WISH, HEARTBEAT])
    bench.plc.power_up(INSIDE)
    await bench.run(3)
    assert not bench.events("changed_by_hand")
    before, bench.cycle = bench.cycle, bench.build()
    bench.cycle.carry_over(before, [*WISH, HEARTBEAT])
    bench.plc.by_hand("heating_setpoint", SAFE["heating_setpoint"])
    await bench.run(2)
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]


async def test_a_fallback_between_the_first_look_after_a_silence_and_the_heartbeat_is_no_hand():
    bench = bench_of()
    await bench.run(5)
    bench.plc.silent = True
    await bench.run(12)
    bench.plc.silent = False
    write = bench.plc.write

    async def too_late(name, value):
        if name == HEARTBEAT:
            bench.plc.values |= SAFE
            bench.plc.write = write
        await write(name, value)

    bench.plc.write = too_late
    await bench.run(4)
    assert not bench.events("changed_by_hand")
    assert {name: bench.plc.values[name] for name in WISH} == WISH


def test_zero_is_counted_only_where_there_is_no_other_number():
    assert [count.next() for count in [BeatCount(3)] for _ in range(5)] == [1, 2, 3, 1, 2]
    assert [count.next() for count in [BeatCount(1)] for _ in range(4)] == [1, 0, 1, 0]


def test_a_register_that_never_kept_a_number_proves_nothing():
    count = BeatCount()
    for _ in range(3):
        count.next()
        count.arrived()
        assert not count.was_cleared(0.0)
    assert not count.note()


def test_a_register_that_kept_its_number_over_a_restart_was_not_cleared():
    count = BeatCount()
    count.next()
    count.arrived()
    assert not count.was_cleared(1.0)
    again = BeatCount()
    again.recall(count.note())
    assert not again.was_cleared(1.0)
    assert again.next() == 2
    again.arrived()
    assert again.was_cleared(0.0)
    assert not again.was_cleared(0.0)
