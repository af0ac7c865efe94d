"""What one bad reading may do (nothing), what several do, and how a sensor that is well again is believed."""

import math

import numpy as np
import pytest

from igrow.edge.guard import DEFAULT_INTERLOCKS, PointRule
from igrow.edge.image import Quality
from igrow.edge.sensors import default_rule
from tests.control.control_fakes import FixedSource
from tests.control.stubborn_plc import RULES, make_stubborn_bench

VENT = PointRule(low=0.0, high=100.0, safe=0.0, dead_band=2.0, decided=False)
WISH = {"heating_setpoint": 21.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
MEASURED = {"air_temperature": 20.0, "air_co2": 600.0, "wind_speed": 3.0, "air_humidity": 70.0, "par": 100.0}


def bench_of(**more):
    """With the built-in interlocks and sensors, at a cycle of 10 s."""
    return make_stubborn_bench(
        FixedSource(dict(WISH)),
        values=MEASURED | {"vent_lee": 60.0, "vent_wind": 40.0},
        rules={**RULES, "vent_lee": VENT, "vent_wind": VENT},
        decided=tuple(RULES),
        interlocks=DEFAULT_INTERLOCKS,
        sensors={name: default_rule(name, poll_period=10.0) for name in MEASURED},
        **more,
    )


def stands(bench):
    return {name: bench.plc.values[name] for name in (*WISH, "vent_lee", "vent_wind")}


BAD = [("air_temperature", x) for x in (math.nan, math.inf, -math.inf, 85.0, -40.0, 45.0)]
BAD += [("air_co2", x) for x in (math.nan, math.inf, 0.0, 60_000.0)]
BAD += [("wind_speed", x) for x in (math.nan, -math.inf, 99.0, -5.0)]
BAD += [("air_humidity", x) for x in (math.nan, 130.0, 5.0)]


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize(("sensor", "value"), BAD)
async def test_one_bad_reading_or_two_move_nothing_and_raise_no_alarm(sensor, value, count):
    bench = bench_of()
    await bench.run(10)
    before, writes = stands(bench), len(bench.plc.writes)
    good = bench.plc.values[sensor]
    bench.plc.values[sensor] = value
    await bench.run(count)
    assert bench.result.image.value_of(sensor).in_doubt
    bench.plc.values[sensor] = good
    await bench.run(60)
    assert stands(bench) == before
    assert {name for _, name, _ in bench.plc.writes[writes:]} == {"heartbeat"}
    assert not bench.store.alarms


SAFE_SIDE = {
    "air_temperature": {"heating_setpoint": 18.0, "lamp_on": 0.0},
    "air_co2": {"co2_setpoint": 400.0},
    "wind_speed": {"vent_lee": 20.0, "vent_wind": 0.0},
    "air_humidity": {},
}


@pytest.mark.parametrize(("sensor", "value"), BAD)
async def test_three_bad_readings_take_the_documented_consequence_with_an_alarm_and_then_let_go(sensor, value):
    bench = bench_of()
    await bench.run(10)
    before, good = stands(bench), bench.plc.values[sensor]
    bench.plc.values[sensor] = value
    await bench.run(4)
    assert stands(bench) == before | SAFE_SIDE[sensor]
    assert f"sensor {sensor}" in bench.alarms
    bench.plc.values[sensor] = good
    await bench.run(1)
    assert stands(bench) == before | SAFE_SIDE[sensor], "one good reading is not enough"
    await bench.run(2)
    assert stands(bench) == before
    await bench.run(100)
    assert stands(bench) == before
    assert not bench.alarms


@pytest.mark.parametrize("sensor", list(MEASURED))
@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf])
async def test_a_register_that_holds_no_number_is_a_missing_value_with_an_alarm(sensor, nothing):
    bench = bench_of()
    await bench.run(5)
    bench.plc.values[sensor] = nothing
    await bench.run(5)
    value = bench.result.image.value_of(sensor)
    assert (value.value, value.quality) == (None, Quality.MISSING)
    assert bench.alarms[f"sensor {sensor}"] == f"{sensor} is missing: the register holds no number"


async def test_without_a_number_for_co2_no_setpoint_is_raised():
    bench = bench_of()
    bench.cycle.sources[0].setpoints["co2_setpoint"] = 513.0
    await bench.run(10)
    bench.plc.values["air_co2"] = math.nan
    for wish in range(520, 1000, 10):
        bench.cycle.sources[0].setpoints["co2_setpoint"] = float(wish)
        await bench.run(2)
        assert bench.plc.values["co2_setpoint"] <= 513.0
    assert bench.plc.values["co2_setpoint"] == 400.0


async def test_a_reading_in_doubt_holds_what_hangs_on_it_where_it_is_and_nothing_else():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["air_co2"] = 0.0
    bench.cycle.sources[0].setpoints |= {"co2_setpoint": 900.0, "heating_setpoint": 23.0}
    await bench.run(1)
    assert bench.plc.values["co2_setpoint"] == 700.0
    assert bench.plc.values["heating_setpoint"] == 23.0
    (row,) = [row for row in bench.store.writes if row.outcome == "clamped"]
    assert (row.point, row.requested) == ("co2_setpoint", 900.0)
    assert "air_co2: 0 ppm is outside" in row.reason


async def test_a_gust_within_reason_closes_the_vents_at_once():
    """A single reading that can be believed is acted on: wind may grow as fast as that."""
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["wind_speed"] = 20.0
    await bench.run(1)
    assert (bench.plc.values["vent_lee"], bench.plc.values["vent_wind"]) == (10.0, 0.0)


async def test_a_bad_reading_in_a_storm_opens_no_vent():
    bench = bench_of()
    await bench.run(5)
    bench.plc.values["wind_speed"] = 20.0
    await bench.run(5)
    for value in (math.nan, 20.0, 99.0, 99.0, 20.0, math.nan):
        bench.plc.values["wind_speed"] = value
        await bench.run(1)
        assert (bench.plc.values["vent_lee"], bench.plc.values["vent_wind"]) == (10.0, 0.0)


async def test_the_first_readings_of_a_start_that_fail_switch_nothing():
    bench = bench_of()
    bench.plc.values |= WISH
    bench.plc.values["air_temperature"] = math.nan
    await bench.run(2)
    assert stands(bench)["lamp_on"] == 1.0
    bench.plc.values["air_temperature"] = 20.0
    await bench.run(5)
    assert bench.plc.written("lamp_on") == []
    bench.plc.values["air_temperature"] = math.nan
    await bench.run(5)
    assert bench.plc.values["lamp_on"] == 0.0


async def test_a_sensor_that_never_answers_is_believed_missing_after_some_cycles():
    bench = bench_of()
    bench.plc.values |= WISH
    bench.plc.unreadable = {"air_temperature"}
    await bench.run(2)
    assert bench.plc.values["lamp_on"] == 1.0
    await bench.run(2)
    assert bench.plc.values["lamp_on"] == 0.0
    assert "sensor air_temperature" in bench.alarms


async def test_a_light_sensor_whose_zero_wanders_is_a_good_sensor():
    bench = bench_of()
    noise = np.random.default_rng(1)
    for _ in range(1000):
        bench.plc.values["par"] = 0.02 * float(noise.standard_normal())
        await bench.run(1)
        value = bench.result.image.value_of("par")
        assert value.quality is Quality.GOOD
        assert value.value >= 0.0
    assert not bench.store.alarms


async def test_a_sensor_at_the_edge_of_its_range_is_one_alarm_and_not_hundreds():
    bench = bench_of()
    noise = np.random.default_rng(1)

    async def run(cycles, humidity):
        for _ in range(cycles):
            for name, value in (MEASURED | {"air_humidity": humidity}).items():
                bench.plc.values[name] = value + 0.5 * float(noise.standard_normal())
            await bench.run(1)

    await run(1000, 101.0)
    sensors = [alarm for alarm in bench.store.alarms if alarm.name.startswith("sensor")]
    assert [(alarm.name, alarm.active) for alarm in sensors] == [("sensor air_humidity", True)]
    await run(200, 85.0)
    assert not bench.alarms


async def test_a_sensor_that_is_bad_every_other_time_is_no_alarm_and_moves_nothing():
    bench = bench_of()
    await bench.run(5)
    before = stands(bench)
    for number in range(200):
        bench.plc.values["air_temperature"] = 85.0 if number % 2 else 20.0 + 0.01 * number
        await bench.run(1)
    assert stands(bench) == before
    assert not bench.store.alarms
