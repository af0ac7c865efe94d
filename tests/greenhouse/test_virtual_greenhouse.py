"""The plant behind the virtual PLC: stepped at any pace, saved, restored, and safe when nobody commands."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, HiddenEffect, VirtualGreenhouse, recipe
from igrow.core.quantities import QUANTITIES, SETPOINTS, USUAL_SETPOINTS, Kind
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, WINTER, hours


def greenhouse(weather: Telemetry, start: np.datetime64 = WINTER) -> VirtualGreenhouse:
    effects = [HiddenEffect("pipe_lag"), HiddenEffect("vent_backlash")]
    return VirtualGreenhouse(
        GreenhouseParameters(), weather, start, seed=2, effects=effects,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )  # fmt: skip


def test_the_sensors_show_every_quantity_within_its_range(winter: Telemetry) -> None:
    plant = greenhouse(winter)
    for _ in range(24):
        plant.step(300, recipe(plant.time))
    measured = plant.measurements()
    known = {name for name, quantity in QUANTITIES.items() if quantity.kind is not Kind.MARK}
    assert set(measured) == known - {*SETPOINTS} | {*USUAL_SETPOINTS}  # the others the recipe does not give
    for name, value in measured.items():
        assert QUANTITIES[name].holds(value), name


def test_time_follows_the_steps(winter: Telemetry) -> None:
    plant = greenhouse(winter)
    plant.step(90)
    plant.step(10)
    assert plant.time == WINTER + np.timedelta64(100, "s")


def test_many_small_steps_are_one_large_step(winter: Telemetry) -> None:
    fast, slow = greenhouse(winter), greenhouse(winter)
    setpoints = recipe(WINTER + hours(12))
    fast.step(3600, setpoints)
    for _ in range(360):
        slow.step(10, setpoints)
    for name in ("air_temperature", "air_humidity", "air_co2"):
        assert slow.truth()[name] == pytest.approx(fast.truth()[name], abs={"air_co2": 1.0}.get(name, 0.05))


def test_a_restored_plant_goes_on_as_if_nothing_had_been(winter: Telemetry) -> None:
    first = greenhouse(winter)
    for _ in range(20):
        first.step(300, recipe(first.time))
    saved = pickle.loads(pickle.dumps(first.state))
    for _ in range(30):
        first.step(300, recipe(first.time))
    second = greenhouse(winter)
    second.state = saved
    for _ in range(30):
        second.step(300, recipe(second.time))
    assert second.measurements() == first.measurements()
    assert second.resources() == first.resources()


def test_the_same_seed_gives_the_same_greenhouse_and_another_one_not(winter: Telemetry) -> None:
    runs = []
    for seed in (1, 1, 2):
        plant = VirtualGreenhouse(GreenhouseParameters(), winter, WINTER, seed=seed)
        plant.step(3600, recipe(WINTER))
        runs.append(plant.measurements()["air_temperature"] + plant.measurements()["air_co2"])
    assert runs[0] == runs[1] != runs[2]


def test_without_commands_the_plc_holds_its_safe_setpoints(winter: Telemetry) -> None:
    plant = VirtualGreenhouse(GreenhouseParameters(), winter, WINTER, seed=1)
    for _ in range(6 * 12):
        plant.step(300)
    measured = plant.measurements()
    assert measured["heating_setpoint"] == 17.0
    assert measured["lamp_on"] == 0.0
    assert 15.5 < measured["air_temperature"] < 20.0


def test_the_end_of_the_weather_is_said_in_one_line(winter: Telemetry) -> None:
    short = winter.select(None, WINTER + hours(2))
    plant = VirtualGreenhouse(GreenhouseParameters(), short, WINTER)
    with pytest.raises(IgrowError, match=r"weather: it reaches from 2020-01-12T00:00:00Z to .* is outside"):
        plant.step(3 * 3600)


def test_weather_without_a_needed_column_is_refused_by_name(winter: Telemetry) -> None:
    poor = winter.only(["outdoor_temperature", "outdoor_humidity", "global_radiation"])
    with pytest.raises(IgrowError, match="no values of wind_speed"):
        VirtualGreenhouse(GreenhouseParameters(), poor, WINTER)


def test_optional_weather_may_be_absent_and_have_gaps(spring: Telemetry) -> None:
    few = spring.only(["outdoor_temperature", "outdoor_humidity", "global_radiation", "wind_speed"])
    holes = few["outdoor_temperature"].copy()
    holes[40:60] = np.nan
    plant = VirtualGreenhouse(GreenhouseParameters(), few.with_columns({"outdoor_temperature": holes}), SPRING)
    plant.step(6 * 3600, recipe(SPRING))
    assert np.isfinite(list(plant.truth().values())).all()
