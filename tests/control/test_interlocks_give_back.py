"""An interlock gives back what it took: to the source that decides, to a hand, or to where the point stood before."""

import itertools
from dataclasses import replace

import pytest

from igrow.edge.guard import DEFAULT_INTERLOCKS, PointRule
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.image import Quality
from igrow.edge.sensors import SensorRule
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import RULES, make_stubborn_bench
from tests.control.test_starts_seen_by_halves import lose

VENT = PointRule(low=0.0, high=100.0, safe=0.0, dead_band=2.0, minimum_interval=180.0, decided=False)
VENTS = {**RULES, "vent_lee": VENT, "vent_wind": VENT}
OPEN = {"vent_lee": 60.0, "vent_wind": 40.0}


def bench_of(values=None, **more):
    wishes = FixedSource({"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5})
    settings = {"rules": VENTS, "decided": tuple(RULES), "interlocks": DEFAULT_INTERLOCKS} | more
    return make_stubborn_bench(wishes, values={**OPEN, "air_humidity": 70.0, **(values or {})}, **settings)


def vents(bench):
    return bench.plc.values["vent_lee"], bench.plc.values["vent_wind"]


async def storm(bench, cycles=30):
    bench.plc.values["wind_speed"] = 20.0
    await bench.run(cycles)


async def calm(bench, cycles=30):
    bench.plc.values["wind_speed"] = 3.0
    await bench.run(cycles)


async def test_after_a_storm_the_vents_stand_where_they_stood_before():
    bench = bench_of()
    await bench.run(3)
    await storm(bench)
    assert vents(bench) == (10.0, 0.0)
    await calm(bench)
    assert vents(bench) == (60.0, 40.0)
    rows = [row for row in bench.store.writes if row.point == "vent_lee" and row.outcome == "written"]
    assert [(row.applied, row.source) for row in rows] == [(10.0, "interlock"), (60.0, "interlock")]
    assert "interlock wind" in rows[0].reason
    assert rows[1].reason == "back to 60 %, where it stood before interlock wind took it"
    assert not bench.events("changed_by_hand")


async def test_during_a_storm_source_reason_and_alarm_say_what_rules():
    bench = bench_of()
    await bench.run(3)
    await storm(bench, 2)
    status = bench.result.setpoints["vent_lee"]
    assert status.source == "interlock"
    assert "wind_speed 20 m s-1, above 15 m s-1" in status.why
    assert "vent_lee" in bench.alarms["interlock wind"]
    await calm(bench, 2)
    assert "back to 60" in bench.result.setpoints["vent_lee"].why
    await calm(bench, 30)
    assert "interlock wind" not in bench.alarms
    assert bench.result.setpoints["vent_lee"].source == ""


async def test_vents_open_again_by_their_slew_and_interval():
    slow = replace(VENT, slew=200.0 / 3600.0)
    bench = bench_of(rules={**RULES, "vent_lee": slow, "vent_wind": slow})
    await bench.run(3)
    await storm(bench)
    await calm(bench, 18 * 6)
    assert vents(bench) == (60.0, 40.0)
    steps = bench.plc.written("vent_lee")[1:]
    assert all(abs(b - a) <= 200.0 / 3600.0 * 200.0 for a, b in itertools.pairwise(steps))


async def test_a_vent_that_the_plc_opens_again_is_no_hand():
    bench = bench_of()
    await bench.run(3)
    await storm(bench)
    bench.plc.values |= {"wind_speed": 3.0, "vent_lee": 35.0}
    await bench.run(60)
    assert bench.plc.values["vent_lee"] == 35.0
    assert not bench.events("changed_by_hand")
    assert bench.result.setpoints["vent_lee"].held_until is None


async def test_vents_that_the_plc_moves_in_fair_weather_are_no_hand_and_no_business_of_ours():
    bench = bench_of()
    for opening in range(0, 100, 5):
        bench.plc.values["vent_lee"] = float(opening)
        await bench.run(2)
    assert not bench.events("changed_by_hand")
    assert bench.plc.written("vent_lee") == []


async def test_a_plc_that_opens_a_vent_against_an_interlock_is_an_alarm_and_the_vent_is_closed_again():
    bench = bench_of()
    await bench.run(3)
    await storm(bench, 5)
    bench.plc.values["vent_wind"] = 50.0
    await bench.run(1)
    assert bench.plc.values["vent_wind"] == 0.0
    assert "the PLC moves it to 50" in bench.alarms["write vent_wind"]
    await bench.run(2)
    assert "write vent_wind" not in bench.alarms
    await calm(bench)
    assert bench.plc.values["vent_wind"] == 50.0


async def test_two_storms_in_a_row_give_back_what_stood_before_the_first_one():
    bench = bench_of()
    await bench.run(3)
    await storm(bench)
    await calm(bench, 2)
    await storm(bench)
    await calm(bench)
    assert vents(bench) == (60.0, 40.0)


async def test_rain_after_the_storm_keeps_its_own_bound_and_the_rest_is_given_back_later():
    bench = bench_of({"rain": 0.0})
    await bench.run(3)
    await storm(bench)
    bench.plc.values["rain"] = 1.0
    await calm(bench)
    assert vents(bench) == (60.0, 10.0)
    bench.plc.values["rain"] = 0.0
    await bench.run(30)
    assert vents(bench) == (60.0, 40.0)


async def test_a_wind_sensor_that_fails_and_comes_back_gives_the_vents_back():
    bench = bench_of(sensors={"wind_speed": SensorRule(0.0, 60.0, bad_samples=3, stale_after=30.0)})
    await bench.run(3)
    bench.plc.values["wind_speed"] = float("nan")
    await bench.run(10)
    assert bench.result.image.value_of("wind_speed").quality is Quality.MISSING
    assert vents(bench) == (20.0, 0.0)
    await calm(bench)
    assert vents(bench) == (60.0, 40.0)


async def test_an_interlock_gives_a_hand_back_what_the_hand_had_set():
    bench = bench_of({"air_temperature": 20.0})
    await bench.run(5)
    bench.plc.values["heating_setpoint"] = 23.0
    await bench.run(5)
    bench.plc.values["air_temperature"] = 40.0
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 18.0
    bench.plc.values["air_temperature"] = 30.0
    await bench.run(5)
    assert bench.plc.values["heating_setpoint"] == 23.0
    assert len(bench.events("changed_by_hand")) == 1
    await bench.run(720)
    assert bench.plc.values["heating_setpoint"] == 21.0


async def test_an_interlock_gives_a_setpoint_back_to_the_source_that_decides():
    bench = bench_of()
    await bench.run(3)
    bench.plc.values["air_temperature"] = 40.0
    await bench.run(5)
    assert bench.plc.values["lamp_on"] == 0.0
    bench.plc.values["air_temperature"] = 30.0
    await bench.run(5)
    assert bench.plc.values["lamp_on"] == 1.0
    assert bench.result.setpoints["lamp_on"].source == "plan"


async def test_a_restart_in_the_middle_of_a_storm_forgets_neither_the_storm_nor_what_it_took():
    bench = bench_of()
    await bench.run(3)
    await storm(bench)
    bench.restart()
    bench.plc.values["wind_speed"] = 13.0  # not above what engages it, nor below what lets it go
    await bench.run(10)
    assert vents(bench) == (10.0, 0.0)
    await calm(bench)
    assert vents(bench) == (60.0, 40.0)


async def test_a_stop_leaves_the_plcs_own_vents_alone():
    bench = bench_of()
    await bench.run(3)
    await bench.cycle.stop()
    assert vents(bench) == (60.0, 40.0)
    assert bench.plc.values["heating_setpoint"] == 18.0


async def test_a_stop_after_the_storm_gives_back_what_was_taken_and_a_stop_in_the_storm_does_not():
    bench = bench_of()
    await bench.run(3)
    await storm(bench, 3)
    await bench.cycle.stop()
    assert vents(bench) == (10.0, 0.0)
    await bench.run(1)
    await calm(bench, 1)
    assert vents(bench) == (10.0, 0.0)
    await bench.cycle.stop()
    assert vents(bench) == (60.0, 40.0)


@pytest.mark.parametrize("minutes", [40.0])
async def test_a_vent_that_does_not_close_is_tried_again_and_raises_an_alarm(minutes):
    bench = bench_of()
    bench.plc.makes["vent_lee"] = lambda opening: max(opening, 30.0)
    await bench.run(3)
    await storm(bench, round(minutes * 6))
    assert "the PLC shows 30" in bench.alarms["write vent_lee"]
    assert len(bench.plc.written("vent_lee")) > 10


async def test_a_vent_that_the_plc_moves_is_never_in_question():
    """Who moved it is known: nobody but the PLC does, whatever else of its unit could not be read."""
    bench = bench_of()
    await bench.run(3)
    await storm(bench)
    lose(bench, HEARTBEAT, *RULES)
    await calm(bench, 20)
    bench.plc.values["vent_lee"] = 25.0
    await bench.run(1)
    assert not bench.cycle.readback.in_question
    assert not [clamp for clamp in bench.result.verdict.clamps if clamp.kind == "doubt" and clamp.point in OPEN]
