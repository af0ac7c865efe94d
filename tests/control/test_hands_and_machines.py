"""Who changed a setpoint: a hand at the PLC, or the PLC itself. The hand is never lost and never invented."""

import math
from dataclasses import replace

import pytest

from igrow.edge.bus.errors import NoAnswerError, RefusedError, UnitRestingError
from igrow.edge.bus.plc import Reading
from igrow.edge.guard import Bound, Interlock
from igrow.edge.guard.memory import note
from igrow.edge.guard.point_memory import PointMemory, Sent
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import RULES, SAFE, make_stubborn_bench

WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}


def bench_of(**more):
    return make_stubborn_bench(FixedSource(dict(WISH)), **more)


# a line that is down while another one is up

TWO_UNITS = {
    "air_temperature": "climate", "heating_setpoint": "climate", "co2_setpoint": "climate", "heartbeat": "climate",
    "wind_speed": "weather", "air_co2": "weather", "lamp_on": "weather", "irrigation_on": "weather",
}  # fmt: skip


@pytest.mark.parametrize("unit", ["climate", "weather"])
async def test_a_unit_that_falls_back_while_another_one_answers_is_no_hand(unit):
    bench = bench_of(units=TWO_UNITS)
    await bench.run(3)
    bench.plc.down = {unit}
    await bench.run(90)
    fell = {name: value for name, value in SAFE.items() if TWO_UNITS[name] == unit}
    bench.plc.values |= fell
    bench.plc.down = set()
    await bench.run(2)
    assert {event["point"] for event in bench.events("plc_fell_back")} == fell.keys()
    assert not bench.events("changed_by_hand")
    await bench.run(1)
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_hand_made_while_its_unit_was_down_is_respected():
    bench = bench_of(units=TWO_UNITS)
    await bench.run(3)
    bench.plc.down = {"climate"}
    await bench.run(60)
    bench.plc.values["heating_setpoint"] = 16.0
    bench.plc.down = set()
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 16.0
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]
    assert bench.plc.values["co2_setpoint"] == 700.0


async def test_a_hand_that_sets_the_safe_value_at_a_unit_that_was_there_all_the_time_is_a_hand():
    bench = bench_of(units=TWO_UNITS)
    await bench.run(3)
    bench.plc.down = {"weather"}
    await bench.run(60)
    bench.plc.values["heating_setpoint"] = 18.0
    bench.plc.down = set()
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 18.0
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]


async def test_a_hiccup_of_one_cycle_lets_no_plc_fall_back_so_a_safe_value_after_it_is_a_hand():
    bench = bench_of()
    await bench.run(3)
    bench.plc.silent = True
    await bench.run(1)
    bench.plc.silent = False
    bench.plc.values["heating_setpoint"] = 18.0
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 18.0
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]


async def test_a_plc_that_says_it_did_not_fall_back_has_been_changed_by_hand():
    bench = bench_of(values={"plc_fallback": 0.0})
    await bench.run(3)
    bench.plc.silent = True
    await bench.run(60)
    bench.plc.silent = False
    bench.plc.values["heating_setpoint"] = 18.0
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 18.0


async def test_a_plc_that_misses_the_heartbeat_while_it_can_be_read_falls_back_and_that_is_no_hand():
    bench = bench_of()
    bench.plc.fallback_after = 100.0
    await bench.run(3)
    bench.plc.ignores = {"heartbeat"}
    bench.plc.write_error = UnitRestingError("the unit rests")
    await bench.run(15)
    assert bench.plc.values["heating_setpoint"] == 18.0
    bench.plc.write_error, bench.plc.ignores = None, set()
    await bench.run(2)
    assert not bench.events("changed_by_hand")
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_no_heartbeat_goes_to_a_unit_that_was_no_part_of_the_cycle():
    """A PLC that hears it would leave its fallback, and take its own safe values for ours."""
    bench = bench_of(units=TWO_UNITS)
    await bench.run(3)
    beats = len(bench.plc.written("heartbeat"))
    bench.plc.unreadable = {name for name, unit in TWO_UNITS.items() if unit == "climate"}
    bench.plc.down = {"climate"}
    await bench.run(3)
    assert len(bench.plc.written("heartbeat")) == beats


async def test_one_unit_down_is_one_alarm_and_the_other_one_is_controlled():
    bench = bench_of(units=TWO_UNITS)
    bench.plc.down = {"weather"}
    await bench.run(100)
    assert list(bench.alarms) == ["link weather"]
    assert "wind_speed" in bench.alarms["link weather"]
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert bench.plc.written("lamp_on") == []
    bench.plc.down = set()
    await bench.run(1)
    assert not bench.alarms
    assert bench.plc.values["lamp_on"] == 1.0


# a PLC that starts anew

ZEROS = dict.fromkeys(WISH, 0.0)
OTHER_DEFAULTS = {"heating_setpoint": 16.0, "co2_setpoint": 350.0, "lamp_on": 0.0, "irrigation_on": 0.0}


@pytest.mark.parametrize(
    ("defaults", "cleared"), [(ZEROS, True), (ZEROS, False), (OTHER_DEFAULTS, True), ({"heating_setpoint": 5.0}, True)]
)
@pytest.mark.parametrize("silent", [0, 1, 12])
async def test_the_values_of_a_plc_after_power_up_are_no_hand_and_are_written_again(defaults, cleared, silent):
    bench = bench_of()
    await bench.run(5)
    bench.plc.silent = True
    await bench.run(silent)
    bench.plc.silent = False
    bench.plc.power_up(defaults, heartbeat=cleared)
    await bench.run(3)
    assert not bench.events("changed_by_hand")
    assert {event["point"] for event in bench.events("plc_restarted")} == defaults.keys()
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_after_a_short_power_cut_no_ramp_begins_at_the_lower_limit():
    rules = {**RULES, "heating_setpoint": replace(RULES["heating_setpoint"], slew=4.0 / 3600.0)}
    bench = bench_of(rules=rules)
    bench.plc.values["heating_setpoint"] = 21.0
    await bench.run(5)
    bench.plc.silent = True
    await bench.run(9)
    bench.plc.silent = False
    bench.plc.power_up(ZEROS)
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == pytest.approx(21.0, abs=0.2)


async def test_one_setpoint_set_to_nothing_by_hand_is_a_hand():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 0.0
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 0.0
    assert [event["point"] for event in bench.events("changed_by_hand")] == ["heating_setpoint"]


async def test_two_setpoints_changed_in_one_cycle_within_the_limits_are_a_hand():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values |= {"heating_setpoint": 16.0, "co2_setpoint": 500.0}
    await bench.run(5)
    assert (bench.plc.values["heating_setpoint"], bench.plc.values["co2_setpoint"]) == (16.0, 500.0)


async def test_a_hand_that_had_time_for_several_setpoints_between_two_readings_is_a_hand():
    bench = bench_of(interval=300.0)
    await bench.run(5, seconds=300.0)
    bench.plc.values |= ZEROS
    await bench.run(5, seconds=300.0)
    assert {event["point"] for event in bench.events("changed_by_hand")} == WISH.keys()
    assert {name: bench.plc.values[name] for name in WISH} == ZEROS


async def test_a_hand_comes_back_after_the_plc_started_anew():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    bench.plc.power_up(ZEROS)
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 23.0
    (row,) = [row for row in bench.store.writes if row.source == "hand" and row.outcome == "written"]
    assert "set by hand" in row.reason
    await bench.run(720)
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_hand_comes_back_after_the_plcs_own_fallback():
    bench = bench_of(values={"plc_fallback": 0.0})
    bench.plc.fallback_after = 300.0
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    bench.plc.silent = True
    await bench.run(60)
    assert bench.plc.values["heating_setpoint"] == 18.0
    bench.plc.silent = False
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 23.0


# what a device makes of what is written


async def test_a_plc_that_cuts_what_is_written_is_no_hand_and_says_so_once():
    bench = bench_of()
    bench.plc.makes["co2_setpoint"] = lambda value: min(value, 640.0)
    await bench.run(360)
    assert bench.plc.values["co2_setpoint"] == 640.0
    assert not bench.events("changed_by_hand")
    assert bench.plc.written("co2_setpoint") == [700.0]
    assert "the PLC shows 640" in bench.alarms["write co2_setpoint"]
    bench.cycle.sources[0].setpoints["co2_setpoint"] = 800.0
    await bench.run(60)
    assert bench.plc.written("co2_setpoint") == [700.0, 800.0]
    bench.cycle.sources[0].setpoints["co2_setpoint"] = 600.0
    await bench.run(3)
    assert bench.plc.values["co2_setpoint"] == 600.0
    assert not bench.alarms


@pytest.mark.parametrize("way", [round, math.floor, math.ceil])
async def test_a_plc_that_rounds_is_no_hand_and_costs_no_further_writes(way):
    bench = bench_of()
    bench.plc.makes["heating_setpoint"] = lambda value: 0.5 * way(value / 0.5)
    for wish in (20.7, 20.75, 19.3, 23.2):
        bench.cycle.sources[0].setpoints["heating_setpoint"] = wish
        await bench.run(30)
        assert abs(bench.plc.values["heating_setpoint"] - wish) < 0.5
    assert bench.plc.written("heating_setpoint") == [20.7, 19.3, 23.2]
    assert not bench.events("changed_by_hand")
    assert not bench.alarms
    bench.plc.values["heating_setpoint"] = 16.0
    await bench.run(3)
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [16.0]


async def test_a_slow_ramp_through_a_coarse_register_is_no_hand():
    rules = {**RULES, "heating_setpoint": replace(RULES["heating_setpoint"], slew=4.0 / 3600.0, minimum_interval=300.0)}
    bench = bench_of(rules=rules)
    bench.plc.makes["heating_setpoint"] = lambda value: 0.5 * round(value / 0.5)
    await bench.run(360)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert not bench.events("changed_by_hand")
    assert not bench.store.alarms


async def test_a_plc_that_ignores_small_steps_is_found_out_when_they_add_up():
    bench = bench_of()
    bench.plc.ignores = {"heating_setpoint"}
    for wish in (18.2, 18.4, 18.6, 18.8):
        bench.cycle.sources[0].setpoints["heating_setpoint"] = wish
        await bench.run(10)
    assert "the PLC shows 18" in bench.alarms["write heating_setpoint"]


@pytest.mark.parametrize("seconds", [15.0, 55.0, 300.0])
async def test_a_plc_that_applies_a_write_late_is_no_hand(seconds):
    bench = bench_of()
    bench.plc.takes["heating_setpoint"] = seconds
    await bench.run(60)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert not bench.events("changed_by_hand")
    assert "write heating_setpoint" not in bench.alarms


async def test_a_plc_that_ramps_is_no_hand_and_its_ramp_is_left_alone():
    bench = bench_of()
    bench.plc.ramps["heating_setpoint"] = 1.0 / 120.0
    await bench.run(100)
    assert bench.plc.values["heating_setpoint"] == 21.0
    assert bench.plc.written("heating_setpoint") == [21.0]
    assert not bench.events("changed_by_hand")
    assert not bench.store.alarms


async def test_a_ramp_that_passes_the_safe_value_after_a_silence_is_no_hand_behind_it():
    source = FixedSource(dict(WISH) | {"heating_setpoint": 15.5})
    bench = make_stubborn_bench(source)
    await bench.run(5)
    bench.plc.ramps["heating_setpoint"] = 0.25
    bench.pass_time(300.0)
    source.setpoints["heating_setpoint"] = 21.0
    await bench.run(30)
    assert not bench.events("changed_by_hand")
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_hand_in_the_middle_of_a_ramp_of_the_plc_is_a_hand():
    bench = bench_of()
    bench.plc.ramps["heating_setpoint"] = 1.0 / 120.0
    await bench.run(12)
    bench.plc.by_hand("heating_setpoint", 15.0)
    await bench.run(5)
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [15.0]
    assert bench.plc.values["heating_setpoint"] == 15.0


@pytest.mark.parametrize("value", [15.0, 17.0, 22.0, 23.0, 26.0])
async def test_a_hand_made_in_the_same_second_as_our_write_is_a_hand(value):
    bench = bench_of()
    await bench.run(1)
    assert bench.plc.written("heating_setpoint") == [21.0]
    bench.plc.values["heating_setpoint"] = value
    await bench.run(30)
    assert bench.plc.values["heating_setpoint"] == value
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [value]


async def test_a_plc_that_swaps_two_setpoints_is_no_hand_and_the_alarm_says_what_it_is():
    bench = bench_of()
    bench.plc.swapped = {"heating_setpoint": "co2_setpoint", "co2_setpoint": "heating_setpoint"}
    await bench.run(30)
    assert not bench.events("changed_by_hand")
    assert not bench.events("plc_restarted")
    assert "is the register map right?" in bench.alarms["write heating_setpoint"]
    assert "written to heating_setpoint" in bench.alarms["write co2_setpoint"]


async def test_a_setpoint_that_can_only_be_written_is_written_once_and_said_so():
    bench = bench_of()
    bench.plc.unreadable = {"heating_setpoint"}
    await bench.run(120)
    assert bench.plc.written("heating_setpoint") == [21.0]
    assert "cannot be read back" in bench.alarms["write heating_setpoint"]
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 19.0
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 19.0


async def test_a_setpoint_that_is_seldom_read_is_looked_at_after_a_silence_before_it_is_called_unreadable():
    """The write was lost in the outage; it is sent again, however seldom the point is read."""
    bench = bench_of()
    bench.plc.polls = {"irrigation_on": 300.0}
    bench.plc.ignores = {"irrigation_on"}
    await bench.run(2)
    assert bench.plc.values["irrigation_on"] == SAFE["irrigation_on"]
    bench.plc.ignores = set()
    bench.plc.silent = True
    await bench.run(121)
    bench.plc.silent = False
    await bench.run(40)
    assert bench.plc.values["irrigation_on"] == WISH["irrigation_on"]
    assert not bench.alarms


async def test_setpoints_that_are_seldom_read_are_read_before_they_are_written():
    """A hand made since the last reading would be lost otherwise."""
    bench = bench_of()
    bench.plc.polls = {"heating_setpoint": 300.0}
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 21.0
    bench.plc.values["heating_setpoint"] = 16.0
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 23.0
    await bench.run(20)
    assert bench.plc.values["heating_setpoint"] == 16.0
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [16.0]


async def test_a_write_to_a_setpoint_that_is_seldom_read_waits_for_its_reading_before_it_counts_as_lost():
    bench = bench_of()
    bench.plc.polls = {"heating_setpoint": 300.0}
    await bench.run(60)
    assert bench.plc.written("heating_setpoint") == [21.0]
    assert not bench.store.alarms


async def test_a_slow_ramp_of_a_setpoint_that_is_seldom_read_goes_on():
    rules = {**RULES, "heating_setpoint": replace(RULES["heating_setpoint"], slew=4.0 / 3600.0)}
    bench = bench_of(rules=rules)
    bench.plc.polls = {"heating_setpoint": 300.0}
    await bench.run(360)
    assert bench.plc.values["heating_setpoint"] == pytest.approx(21.0, abs=0.11)


# somebody operates the PLC by hand

STORM = Interlock("wind", "wind_speed", {"lamp_on": Bound(high=0.0)}, above=15.0, release=10.0)


async def test_while_the_plc_is_operated_by_hand_nothing_is_written_but_the_heartbeat():
    bench = bench_of(values={"plc_manual": 1.0, "wind_speed": 20.0}, interlocks=(STORM,))
    bench.plc.values["lamp_on"] = 1.0
    await bench.run(20)
    report = await bench.cycle.stop()
    assert {name for _, name, _ in bench.plc.writes} == {"heartbeat"}
    assert len(bench.plc.written("heartbeat")) == 20
    assert report.manual
    assert len(bench.events("plc_by_hand")) == 1


async def test_an_interlock_acts_as_soon_as_nobody_operates_the_plc_by_hand_any_more():
    bench = bench_of(values={"plc_manual": 1.0, "wind_speed": 20.0, "lamp_on": 1.0}, interlocks=(STORM,))
    await bench.run(5)
    bench.plc.values["plc_manual"] = 0.0
    await bench.run(1)
    assert bench.plc.values["lamp_on"] == 0.0
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_plc_whose_manual_switch_cannot_be_read_stays_as_it_last_said():
    bench = bench_of(values={"plc_manual": 1.0}, units={"plc_manual": "panel"})
    await bench.run(3)
    bench.plc.down = {"panel"}
    await bench.run(300)
    assert {name for _, name, _ in bench.plc.writes} == {"heartbeat"}


async def test_the_manual_switch_is_read_in_every_cycle_however_seldom_its_map_says():
    bench = bench_of(values={"plc_manual": 0.0})
    bench.plc.polls = {"plc_manual": 300.0}
    await bench.run(3)
    bench.plc.values["plc_manual"] = 1.0
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 24.0
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_a_start_while_the_manual_switch_cannot_be_read_takes_it_as_it_last_stood():
    bench = bench_of(values={"plc_manual": 1.0}, units={"plc_manual": "panel"})
    await bench.run(3)
    bench.plc.down = {"panel"}
    bench.restart()
    await bench.run(30)
    assert {name for _, name, _ in bench.plc.writes} == {"heartbeat"}


async def test_what_was_set_while_the_plc_was_operated_by_hand_is_respected_afterwards():
    bench = bench_of(values={"plc_manual": 0.0})
    await bench.run(3)
    bench.plc.values["plc_manual"] = 1.0
    await bench.run(3)
    bench.plc.values["heating_setpoint"] = 16.0
    await bench.run(3)
    bench.plc.values["plc_manual"] = 0.0
    await bench.run(3)
    assert bench.plc.values["heating_setpoint"] == 16.0


# alarms end with their cause


async def test_the_alarm_of_a_write_that_was_not_taken_ends_when_a_hand_takes_over():
    bench = bench_of()
    bench.plc.ignores = {"heating_setpoint"}
    await bench.run(20)
    assert "write heating_setpoint" in bench.alarms
    bench.plc.values["heating_setpoint"] = 16.0
    await bench.run(1)
    assert not bench.alarms


async def test_the_alarm_of_a_write_that_was_not_taken_ends_when_nobody_wants_it_any_more():
    bench = bench_of()
    bench.plc.ignores = {"heating_setpoint"}
    await bench.run(20)
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 18.0
    await bench.run(1)
    assert not bench.alarms


async def test_the_alarm_of_a_write_that_was_not_taken_ends_when_the_plc_started_anew_and_took_it():
    bench = bench_of()
    bench.plc.ignores = {"heating_setpoint"}
    await bench.run(20)
    bench.plc.ignores = set()
    bench.plc.power_up(ZEROS)
    await bench.run(2)
    assert not bench.alarms


async def test_the_alarm_of_a_write_that_the_bus_did_not_carry_ends_when_nobody_wants_it_any_more():
    bench = bench_of()
    bench.plc.write_error = UnitRestingError("the unit rests")
    await bench.run(3)
    assert "bus heating_setpoint" in bench.alarms
    bench.plc.values |= WISH
    await bench.run(8)  # a minute in which nobody wanted it
    assert "bus heating_setpoint" not in bench.alarms


# what a line that loses answers makes of it


class Refusing:
    """A PLC that does what it is told, and says that it did not."""

    def __init__(self, plc, point):
        self.write, self.point = plc.write, point

    async def __call__(self, name, value):
        await self.write(name, value)
        if name == self.point:
            raise RefusedError(f"{name}: refused", 4)


@pytest.mark.parametrize("point", ["heating_setpoint", "heartbeat"])
async def test_a_write_that_was_refused_and_done_all_the_same_is_no_hand_and_no_restart(point):
    bench = bench_of()
    await bench.run(3)
    write, bench.plc.write = bench.plc.write, Refusing(bench.plc, point)
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 24.0
    await bench.run(1)
    bench.plc.write = write
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 24.0
    assert not bench.events("changed_by_hand")
    assert not bench.events("plc_restarted")


async def test_a_write_that_was_refused_and_done_all_the_same_is_remembered_over_a_restart():
    bench = bench_of()
    await bench.run(3)
    bench.plc.write = Refusing(bench.plc, "heating_setpoint")
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 24.0
    await bench.run(1)
    bench.cycle._keep(bench.result.image, note(bench.cycle.state, bench.cycle.readback))  # as the next cycle does
    bench.restart()
    await bench.run(2)
    assert not bench.events("changed_by_hand")


def test_a_write_that_was_lost_behind_one_that_was_done_is_no_limit_of_the_device():
    rule, first, second = RULES["irrigation_on"], Sent(0.1, 1.0), Sent(0.5, 2.0)
    memory = PointMemory(stands=0.3, sent=[first, second])
    memory.applied(first, 0.1, 3.0)
    assert not memory.is_limited(rule, second.value)
    memory.move_to(0.2, 4.0)
    assert memory.is_limited(rule, second.value)


async def test_what_stands_outside_the_limits_is_never_left_there_for_a_limit_of_the_device():
    """Between what stood and what was written, as after a start of the PLC, and below what the greenhouse can bear."""
    bench = bench_of()
    await bench.run(3)
    bench.plc.values["heating_setpoint"] = 0.0
    bench.plc.ramps = {"heating_setpoint": 0.1}
    bench.plc.takes = {}
    bench.cycle.readback.points["heating_setpoint"].stands = 0.0
    bench.cycle.readback.points["heating_setpoint"].answers = None
    await bench.run(1)
    bench.plc._aims.clear()
    bench.plc.values["heating_setpoint"] = 6.0
    bench.plc.ramps = {}
    await bench.run(20)
    assert bench.plc.values["heating_setpoint"] == WISH["heating_setpoint"]


async def test_a_plc_that_has_started_anew_is_not_judged_by_the_part_of_it_that_answers():
    bench = bench_of()
    await bench.run(3)
    read, lost = bench.plc.read, {"co2_setpoint", "lamp_on", "irrigation_on", "heartbeat"}

    async def half(names=None):
        readings = dict(await read(names))
        now = bench.clock.monotonic()
        return readings | {name: Reading(None, NoAnswerError("lost"), now) for name in lost & readings.keys()}

    bench.plc.read = half
    bench.plc.power_up(dict.fromkeys(WISH, 0.0))
    await bench.run(1)
    assert not bench.events("changed_by_hand")
    bench.plc.read = read
    await bench.run(3)
    assert not bench.events("changed_by_hand")
    assert {event["point"] for event in bench.events("plc_restarted")} >= {"heating_setpoint", "co2_setpoint"}
    assert {name: bench.plc.values[name] for name in WISH} == WISH


async def test_a_hand_is_found_although_the_rest_of_its_unit_does_not_answer():
    """The judgement waits, and not for ever; meanwhile the point is left alone."""
    bench = bench_of()
    await bench.run(3)
    read = bench.plc.read

    async def half(names=None):
        readings = dict(await read(names))
        now = bench.clock.monotonic()
        return readings | {n: Reading(None, NoAnswerError("lost"), now) for n in {"lamp_on"} & readings.keys()}

    bench.plc.read = half
    bench.plc.by_hand("heating_setpoint", 16.0)
    bench.cycle.sources[0].setpoints["heating_setpoint"] = 25.0
    await bench.run(12)
    assert bench.plc.values["heating_setpoint"] == 16.0
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [16.0]


async def test_a_fallback_before_the_first_heartbeat_of_a_process_is_no_hand():
    bench = bench_of()
    await bench.run(3)
    bench.pass_time(20.0)
    bench.restart()
    write = bench.plc.write

    async def deaf_to_the_heart(name, value):
        if name == "heartbeat":
            raise UnitRestingError("rests")
        await write(name, value)

    bench.plc.write = deaf_to_the_heart
    await bench.run(5)
    bench.plc.values |= SAFE
    await bench.run(2)
    assert not bench.events("changed_by_hand")


async def test_a_process_writes_to_no_point_that_it_has_not_read_yet():
    """A hand may stand there, made while nobody was there; the others are written."""
    bench = bench_of()
    await bench.run(3)
    bench.restart()
    read = bench.plc.read

    async def but_one(names=None):
        readings = dict(await read(names))
        now = bench.clock.monotonic()
        lost = {"heating_setpoint"} & readings.keys()
        return readings | {name: Reading(None, NoAnswerError("lost"), now) for name in lost}

    bench.plc.by_hand("heating_setpoint", 16.0)
    bench.cycle.sources[0].setpoints |= {"heating_setpoint": 25.0, "co2_setpoint": 800.0}
    bench.plc.read = but_one
    await bench.run(4)
    assert bench.plc.values["heating_setpoint"] == 16.0
    assert bench.plc.values["co2_setpoint"] == 800.0
    bench.plc.read = read
    await bench.run(2)
    assert bench.plc.values["heating_setpoint"] == 16.0


async def test_a_stop_that_could_not_write_explains_no_hand_after_it():
    """Between the safe value that never left and what stood there, it would pass for the PLC's way to it."""
    bench = bench_of()
    await bench.run(3)
    bench.plc.write_error = UnitRestingError("rests")
    bench.clock.advance(1.0)
    await bench.cycle.stop()
    bench.plc.write_error = None
    bench.plc.by_hand("irrigation_on", 0.3)
    bench.pass_time(5.0)
    bench.restart()
    await bench.run(3)
    assert bench.plc.values["irrigation_on"] == 0.3
    assert [event["shown"] for event in bench.events("changed_by_hand")] == [0.3]
