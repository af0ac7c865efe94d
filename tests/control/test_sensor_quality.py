"""Each quality: when a value gets it, and what it does to control."""

import math

import pytest

from igrow.edge.bus.errors import NoAnswerError
from igrow.edge.bus.plc import Reading
from igrow.edge.guard import DEFAULT_INTERLOCKS, GuardRules, GuardState, PointRule, Request, guard
from igrow.edge.image import Image, Quality, Value
from igrow.edge.sensors import CONSEQUENCES, ImageBuilder, SensorRule, TwinSensors, default_rule
from igrow.edge.sensors.consequences import usable_for_control, usable_for_planning
from tests.control.control_fakes import image_of

RULE = SensorRule(-20.0, 60.0, rate=0.01, jump=1.0, frozen_after=3600.0, stale_after=30.0, missing_after=600.0)


class Bench:
    """An image builder fed by hand."""

    def __init__(self, *, twins=(), sun=None, **rules):
        self.builder = ImageBuilder(rules or {"t": RULE}, twins, sun)
        self.now = 0.0

    def read(self, seconds=10.0, **values):
        self.now += seconds
        readings = {name: Reading(value, None, self.now) for name, value in values.items()}
        return self.builder.build(readings, self.now, 1.6e9 + self.now).values

    def fail(self, seconds=10.0, *names):
        self.now += seconds
        readings = {name: Reading(None, NoAnswerError("silence"), self.now) for name in names}
        return self.builder.build(readings, self.now, None)


def test_a_fresh_value_in_range_is_good():
    assert Bench().read(t=20.0)["t"] == Value(20.0, Quality.GOOD, 0.0)


def test_a_point_that_was_never_read_is_missing():
    value = Bench().fail(10.0, "t").values["t"]
    assert value.quality is Quality.MISSING
    assert value.value is None
    assert "silence" in value.why


def test_an_old_value_is_kept_as_stale_and_then_missing():
    bench = Bench()
    bench.read(t=20.0)
    assert bench.fail(30.0, "t").values["t"].quality is Quality.GOOD
    stale = bench.fail(10.0, "t").values["t"]
    assert (stale.value, stale.quality, stale.age) == (20.0, Quality.STALE, 40.0)
    assert bench.fail(600.0, "t").values["t"].quality is Quality.MISSING


def test_the_same_reading_handed_over_again_does_not_make_it_younger():
    bench = Bench()
    reading = Reading(20.0, None, 5.0)
    bench.builder.build({"t": reading}, 0.0, None)
    assert bench.builder.build({"t": reading}, 100.0, None).values["t"].quality is Quality.STALE


@pytest.mark.parametrize("value", [-21.0, 60.1, 1e30])
def test_a_value_outside_the_sensors_range_is_out_of_range(value):
    assert Bench().read(t=value)["t"].quality is Quality.OUT_OF_RANGE


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_register_that_holds_no_number_gives_no_number(value):
    judged = Bench().read(t=value)["t"]
    assert judged.quality is Quality.OUT_OF_RANGE
    assert judged.value is None


def test_a_value_that_stands_still_too_long_is_frozen_and_recovers_at_once():
    bench = Bench()
    for _ in range(7):
        last = bench.read(600.0, t=20.0)["t"]
    assert last.quality is Quality.GOOD
    assert bench.read(600.0, t=20.0)["t"].quality is Quality.FROZEN
    assert bench.read(600.0, t=20.1)["t"].quality is Quality.GOOD


def test_darkness_and_calm_may_stand_still():
    rules = {name: default_rule(name, poll_period=600.0) for name in ("global_radiation", "wind_speed", "air_humidity")}
    bench = Bench(**rules)
    for _ in range(60):
        values = bench.read(600.0, global_radiation=0.0, wind_speed=0.0, air_humidity=100.0)
    assert {value.quality for value in values.values()} == {Quality.GOOD}
    for _ in range(60):
        values = bench.read(600.0, global_radiation=300.0, wind_speed=3.0, air_humidity=60.0)
    assert {value.quality for value in values.values()} == {Quality.FROZEN}


def test_a_spike_is_implausible_and_a_change_that_lasts_is_accepted_in_time():
    bench = Bench()
    bench.read(t=20.0)
    assert bench.read(t=30.0)["t"].quality is Quality.IMPLAUSIBLE
    assert bench.read(t=20.1)["t"].quality is Quality.GOOD
    qualities = [bench.read(100.0, t=26.0)["t"].quality for _ in range(6)]
    assert qualities[0] is Quality.IMPLAUSIBLE
    assert qualities[-1] is Quality.GOOD


def test_two_readings_at_one_moment_of_a_stopped_clock_are_not_too_fast():
    bench = Bench(t=SensorRule(-20.0, 60.0))
    bench.read(t=20.0)
    bench.now -= 1e-3
    assert bench.read(1e-3, t=25.0)["t"].quality is Quality.GOOD


def test_light_by_night_is_implausible():
    bench = Bench(global_radiation=SensorRule(-20, 1500), sun=lambda time: -20.0)
    assert bench.read(global_radiation=300.0)["global_radiation"].quality is Quality.IMPLAUSIBLE
    assert bench.read(global_radiation=1.0)["global_radiation"].quality is Quality.GOOD


def test_par_without_sun_and_lamps_is_implausible():
    wide = SensorRule(-1e6, 1e6)
    bench = Bench(par=wide, global_radiation=wide, lamp_power=wide)
    assert bench.read(par=200.0, global_radiation=0.0, lamp_power=80.0)["par"].quality is Quality.GOOD
    assert bench.read(par=200.0, global_radiation=0.0, lamp_power=0.0)["par"].quality is Quality.IMPLAUSIBLE


VENTS = dict.fromkeys(
    ("vent_lee", "vent_wind", "air_temperature", "outdoor_temperature", "air_humidity", "outdoor_humidity"),
    SensorRule(-1e6, 1e6),
)


def test_heat_and_vapour_that_open_vents_could_not_hold_are_implausible():
    bench = Bench(**VENTS)
    outside = {"outdoor_temperature": 5.0, "outdoor_humidity": 80.0}
    shut = bench.read(vent_lee=0.0, vent_wind=0.0, air_temperature=30.0, air_humidity=80.0, **outside)
    assert shut["air_temperature"].quality is shut["air_humidity"].quality is Quality.GOOD
    wide = bench.read(vent_lee=100.0, vent_wind=100.0, air_temperature=30.0, air_humidity=80.0, **outside)
    assert wide["air_temperature"].quality is wide["air_humidity"].quality is Quality.IMPLAUSIBLE


def test_a_check_leans_on_good_sensors_only():
    bench = Bench(**(VENTS | {"outdoor_temperature": SensorRule(-50, 60)}))
    values = bench.read(
        vent_lee=100.0, vent_wind=100.0, air_temperature=30.0, air_humidity=50.0, outdoor_temperature=-99.0,
        outdoor_humidity=50.0,
    )  # fmt: skip
    assert values["air_temperature"].quality is Quality.GOOD


def test_two_sensors_that_disagree_are_both_doubted_and_one_stands_in_for_the_other():
    bench = Bench(a=RULE, b=RULE, twins=[TwinSensors("a", "b", 1.5)])
    assert bench.read(a=20.0, b=20.5)["a"].quality is Quality.GOOD
    values = bench.read(100.0, a=20.0, b=22.0)
    assert values["a"].quality is values["b"].quality is Quality.IMPLAUSIBLE
    stood_in = bench.read(a=99.0, b=21.5)["a"]
    assert (stood_in.value, stood_in.quality) == (21.5, Quality.GOOD)


def test_a_line_that_answers_nothing_is_told_from_points_that_were_not_due():
    bench = Bench()
    assert not bench.fail(10.0, "t").link_ok
    assert bench.fail(10.0).link_ok


# What each quality does to control: the table in igrow.edge.sensors.consequences, checked against the guard itself.

EXPECTED = {
    Quality.GOOD: (True, True, True),
    Quality.STALE: (True, False, False),
    Quality.OUT_OF_RANGE: (False, False, False),
    Quality.FROZEN: (False, False, False),
    Quality.MISSING: (False, False, False),
    Quality.IMPLAUSIBLE: (False, False, False),
}


@pytest.mark.parametrize("quality", Quality)
def test_the_table_of_consequences_covers_every_quality(quality):
    control, planning, telemetry = EXPECTED[quality]
    value = Value(1.0, quality, 0.0)
    assert (usable_for_control(value) is not None) is control
    assert (usable_for_planning(value) is not None) is planning
    assert CONSEQUENCES[quality].telemetry is telemetry


LIMITS = {
    "heating_setpoint": PointRule(low=12.0, high=28.0, safe=18.0),
    "co2_setpoint": PointRule(low=400.0, high=1000.0, safe=400.0),
    "lamp_on": PointRule(low=0.0, high=1.0, safe=0.0),
    "vent_lee": PointRule(low=0.0, high=100.0, safe=0.0),
    "vent_wind": PointRule(low=0.0, high=100.0, safe=0.0),
}
ASKED = {"heating_setpoint": 25.0, "co2_setpoint": 900.0, "lamp_on": 1.0, "vent_lee": 60.0, "vent_wind": 60.0}


@pytest.mark.parametrize("quality", [quality for quality in Quality if quality is not Quality.GOOD])
@pytest.mark.parametrize(
    ("sensor", "harmless", "safe_side"),
    [
        ("air_temperature", 20.0, {"heating_setpoint": 18.0, "lamp_on": 0.0}),
        ("air_co2", 600.0, {"co2_setpoint": 400.0}),
        ("wind_speed", 2.0, {"vent_lee": 20.0, "vent_wind": 0.0}),
        ("air_humidity", 70.0, {}),
    ],
)
def test_a_sensor_that_cannot_be_believed_moves_its_setpoints_to_the_safe_side(quality, sensor, harmless, safe_side):
    image = Image(0.0, None, {sensor: Value(harmless, quality, 40.0)})
    verdict = guard(
        {name: Request(value, "plan") for name, value in ASKED.items()},
        dict.fromkeys(ASKED, None), {}, image, GuardState(), GuardRules(LIMITS, DEFAULT_INTERLOCKS),
    )  # fmt: skip
    expected = ASKED if EXPECTED[quality][0] else ASKED | safe_side
    assert {write.point: write.value for write in verdict.writes} == expected


def test_a_good_image_leaves_every_request_alone():
    image = image_of(0.0, air_temperature=20.0, air_co2=600.0, wind_speed=2.0, air_humidity=70.0)
    verdict = guard(
        {name: Request(value, "plan") for name, value in ASKED.items()},
        dict.fromkeys(ASKED, None), {}, image, GuardState(), GuardRules(LIMITS, DEFAULT_INTERLOCKS),
    )  # fmt: skip
    assert {write.point: write.value for write in verdict.writes} == ASKED
