"""What a new process of the daemon knows of the old one: hands, intervals, writes on their way, whatever clocks do."""

import json
from dataclasses import replace

import pytest

from igrow.edge.moment import Moment, from_json, this_boot, to_json
from igrow.edge.remembering import NOTE_AGAIN, StateNotes
from tests.control.control_fakes import FixedSource, MemoryStore
from tests.control.stubborn_plc import RULES, SAFE, make_stubborn_bench
from tests.fake_clock import FakeClock

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def bench_of(**more):
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


async def test_a_stop_leaves_a_hand_where_it_is_and_the_rest_at_the_safe_values():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    report = await bench.cycle.stop()
    assert {name: bench.plc.values[name] for name in WISH} == SAFE | {"heating_setpoint": 23.0}
    assert report.by_hand == ("heating_setpoint",)


async def test_a_hand_made_just_before_the_stop_is_seen_and_left():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    bench.clock.advance(10.0)
    await bench.cycle.stop()
    assert bench.plc.values["heating_setpoint"] == 23.0


async def test_a_hand_survives_a_restart_with_its_remaining_time_and_then_ends():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(361)
    await bench.cycle.stop()
    bench.pass_time(60.0)
    bench.restart()
    await bench.run(6)
    assert bench.plc.values["heating_setpoint"] == 23.0
    assert {name: bench.plc.values[name] for name in WISH if name != "heating_setpoint"} == {
        name: value for name, value in WISH.items() if name != "heating_setpoint"
    }
    left = bench.result.setpoints["heating_setpoint"].held_until - bench.clock.monotonic()
    assert left == pytest.approx(7200.0 - 3600.0 - 60.0 - 60.0)
    await bench.run(round(left / 10.0) + 1)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert len(bench.events("changed_by_hand")) == 1


async def test_the_safe_values_that_a_stop_has_written_are_no_hand_after_it():
    bench = bench_of()
    await bench.run(5)
    await bench.cycle.stop()
    bench.pass_time(30.0)
    bench.restart()
    await bench.run(2)
    assert {name: bench.plc.values[name] for name in WISH} == WISH
    assert not bench.events("changed_by_hand")


async def test_a_plc_that_fell_back_between_stop_and_start_is_no_hand_and_a_hand_before_it_comes_back():
    bench = bench_of()
    bench.plc.fallback_after = 900.0
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    await bench.cycle.stop()
    bench.pass_time(1200.0)
    assert bench.plc.values["heating_setpoint"] == 18.0
    bench.restart()
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 23.0
    assert len(bench.events("changed_by_hand")) == 1


async def test_a_hand_made_while_no_daemon_was_there_is_respected():
    bench = bench_of()
    await bench.run(5)
    await bench.cycle.stop()
    bench.pass_time(300.0)
    bench.plc.values["heating_setpoint"] = 15.0
    bench.restart()
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 15.0
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [15.0]


async def test_what_stands_in_the_plc_after_a_long_time_without_a_daemon_is_taken_as_it_is():
    bench = bench_of()
    await bench.run(5)
    await bench.cycle.stop()
    bench.pass_time(86_400.0)
    bench.plc.values["heating_setpoint"] = 15.0
    bench.restart()
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert not bench.events("changed_by_hand")


async def test_a_daemon_killed_between_a_write_and_its_record_does_not_take_its_own_write_for_a_hand():
    bench = bench_of()
    carry_out = bench.cycle._writer.carry_out

    async def killed(writes):
        await carry_out(writes)
        raise SystemExit

    bench.cycle._writer.carry_out = killed
    with pytest.raises(SystemExit):
        await bench.run(1)
    assert bench.plc.values["heating_setpoint"] == 21.0
    bench.restart()
    await bench.run(2)
    assert not bench.events("changed_by_hand")
    assert bench.plc.written("heating_setpoint") == [21.0]


async def test_restarts_do_not_switch_lamps_on_and_off():
    rules = {**RULES, "lamp_on": replace(RULES["lamp_on"], minimum_interval=1800.0)}
    bench = bench_of(rules=rules)
    await bench.run(2)
    for _ in range(3):
        await bench.cycle.stop()
        bench.pass_time(3.0)
        bench.restart()
        await bench.run(2, seconds=1.0)
    assert bench.plc.written("lamp_on") == [1.0, 0.0]
    await bench.run(200)
    assert bench.plc.written("lamp_on") == [1.0, 0.0, 1.0]


async def test_a_restart_begins_no_slew_anew():
    rules = {**RULES, "heating_setpoint": replace(RULES["heating_setpoint"], slew=4.0 / 3600.0, dead_band=0.0)}
    bench = bench_of(rules=rules)
    await bench.run(60)
    stood, at = bench.plc.values["heating_setpoint"], bench.clock.monotonic()
    for _ in range(10):
        bench.restart()
        await bench.run(3)
    passed = bench.clock.monotonic() - at
    assert stood < bench.plc.values["heating_setpoint"] <= stood + 4.0 / 3600.0 * passed + 1e-9


async def test_a_limit_of_the_plc_that_was_learned_is_known_after_a_restart():
    bench = bench_of()
    bench.plc.makes["co2_setpoint"] = lambda value: min(value, 640.0)
    await bench.run(20)
    bench.restart()
    await bench.run(60)
    assert bench.plc.written("co2_setpoint") == [700.0]
    await bench.run(720)
    assert bench.plc.written("co2_setpoint") == [700.0, 700.0], "tried again as soon as a hand would no longer count"
    assert not bench.events("changed_by_hand")


async def test_a_point_that_means_another_register_now_is_looked_at_afresh():
    bench = bench_of()
    await bench.run(5)
    notes = bench.notes.content
    bench.cycle = bench.build()
    bench.cycle.recall(notes, 0.0, same={"co2_setpoint"}, agree=True)
    bench.plc.values |= {"heating_setpoint": 15.0, "co2_setpoint": 500.0}
    await bench.run(2)
    assert {event["point"] for event in bench.events("changed_by_hand")} == {"co2_setpoint"}


@pytest.mark.parametrize(
    "damaged",
    [
        {},
        {"points": []},
        {"points": {"heating_setpoint": 3}, "engaged": "wind"},
        {"points": {"heating_setpoint": {"hand": "x", "held_until": None, "sent": [[1], 2, ["a", "b", "c", "d"]]}}},
        {"points": {"heating_setpoint": {"hand": float("nan"), "written_at": True, "stands": []}}, "engaged": [1]},
    ],
)
async def test_notes_that_make_no_sense_are_as_good_as_none(damaged):
    bench = bench_of()
    bench.cycle.recall(damaged, 0.0, same=RULES, agree=True)
    await bench.run(2)
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_reload_keeps_hands_intervals_interlocks_and_writes_on_their_way():
    rules = {**RULES, "lamp_on": replace(RULES["lamp_on"], minimum_interval=1800.0)}
    bench = bench_of(rules=rules)
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(2)
    bench.cycle.sources[0].setpoints |= {"co2_setpoint": 900.0, "lamp_on": 0.0}
    await bench.run(1)
    before, bench.cycle = bench.cycle, bench.build()
    bench.cycle.carry_over(before, same=bench.plc.values)
    await bench.run(100)
    assert {name: bench.plc.values[name] for name in WISH} == WISH | {"heating_setpoint": 23.0, "co2_setpoint": 900.0}
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]
    assert len([event for event in bench.store.kinds() if event == "source"]) == 1


# how long nobody was there


class Ledger(MemoryStore):
    """A store that keeps states as they are on the disk."""

    def __init__(self):
        super().__init__()
        self.lines: list[str] = []

    def record_state(self, time, content):
        self.lines.append(json.dumps(content))

    def newest_state(self):
        return json.loads(self.lines[-1]) if self.lines else None


async def noted_and_recalled(old: Moment, new: Moment, hand_for: float = 3600.0):
    """Note a hand at one moment and recall it at another one; returns how long it is still respected, by what date."""
    ledger, first, second = Ledger(), bench_of(), bench_of()
    first.clock.now = old.monotonic - 20.0
    notes = StateNotes(ledger, old.boot, dict.fromkeys(RULES, "same"))
    first.cycle._keep = lambda image, content: notes.keep(replace(image, true_time=old.time), content)
    first.cycle.readback._respect_hand = hand_for
    await first.run(1)
    first.plc.values["heating_setpoint"] = 23.0
    await first.run(1)
    second.clock.now = new.monotonic
    notes = StateNotes(ledger, new.boot, dict.fromkeys(RULES, "same"))
    date = notes.recall(second.cycle, ledger.newest_state(), new, respect_hand=7200.0)
    left = second.cycle.readback.held(new.monotonic).get("heating_setpoint")
    return left, None if date is None else round(date)


NOON = 1.7e9
YEARS = 10 * 365 * 86_400.0


@pytest.mark.parametrize(
    ("new", "left", "date"),
    [
        (Moment("a", 5600.0, NOON + 600.0), 3000.0, NOON + 600.0),
        (Moment("a", 5600.0, NOON + YEARS), 3000.0, NOON + 600.0),
        (Moment("a", 5600.0, NOON - YEARS), 3000.0, NOON + 600.0),
        (Moment("a", 5600.0, None), 3000.0, NOON + 600.0),
        (Moment("b", 60.0, NOON + 600.0), 3000.0, NOON + 600.0),
        (Moment("b", 60.0, NOON - YEARS), 3600.0, None),
        (Moment("b", 60.0, None), 3600.0, None),
        (Moment("", 60.0, NOON + 600.0), 3000.0, NOON + 600.0),
        (Moment("a", 15_600.0, NOON + 10_600.0), None, NOON + 10_600.0),
    ],
)
async def test_the_remaining_time_of_a_hand_is_right_whatever_the_clocks_do(new, left, date):
    found = await noted_and_recalled(Moment("a", 5000.0, NOON), new)
    assert found == (pytest.approx(left) if left is not None else None, date)


async def test_a_step_of_the_date_while_the_daemon_runs_changes_no_interval():
    rules = {**RULES, "lamp_on": replace(RULES["lamp_on"], minimum_interval=1800.0)}
    bench = bench_of(rules=rules)
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    for step in (YEARS, -2 * YEARS, YEARS):
        bench.clock.wall += step
        bench.cycle.sources[0].setpoints["lamp_on"] = 1.0 - bench.cycle.sources[0].setpoints["lamp_on"]
        await bench.run(30)
        assert bench.plc.values["heating_setpoint"] == 23.0
    assert bench.plc.written("lamp_on") == [1.0]


def test_the_same_is_noted_once_in_a_while_only():
    ledger = Ledger()
    notes = StateNotes(ledger, "a", {})
    clock = FakeClock()
    from tests.control.control_fakes import image_of

    for _ in range(200):
        clock.advance(10.0)
        notes.keep(image_of(clock.monotonic()), {"points": {}, "engaged": []})
    assert len(ledger.lines) == 2000.0 // NOTE_AGAIN + 1


def test_a_moment_survives_the_ledger():
    moment = Moment(this_boot(), 12.5, None)
    assert from_json(json.loads(json.dumps(to_json(moment)))) == moment
    assert from_json({"boot": 3}) is None
    assert from_json(None) is None


async def test_a_value_that_stopped_short_of_a_lost_write_is_left_alone_after_a_restart_too():
    """A limit of the PLC's, or a hand: by what is read nobody can tell, and written over it would be lost."""
    bench = make_stubborn_bench(FixedSource({"co2_setpoint": 600.0}), values={"co2_setpoint": 500.0})
    bench.plc.ignores.add("co2_setpoint")
    await bench.run(2)
    bench.plc.by_hand("co2_setpoint", 537.0)
    await bench.run(1)
    bench.plc.ignores.clear()
    bench.restart()
    await bench.run(20)
    assert bench.plc.values["co2_setpoint"] == 537.0
