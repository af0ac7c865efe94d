"""Energy, water and carbon: what crosses the boundary is what the plant holds more or less."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, HiddenEffect, recipe
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, WINTER

SCALE = {"energy": 3e7, "vapour": 0.07, "slab": 8.0, "co2": 0.008, "carbohydrate": 1.6}
"""What a greenhouse holds, J m-2 and kg m-2: the residuals are measured by it."""


def run(plant: Plant, steps: int) -> dict[str, float]:
    before = plant.stored()
    for _ in range(steps):
        plant.advance(300, recipe(np.datetime64(int(plant.state.seconds), "s")))
    # It must also hold in the middle of a slow step.
    plant.advance(130, {})
    return {name: float(np.max(np.abs(value))) / SCALE[name] for name, value in plant.residuals(before).items()}


@pytest.mark.parametrize("season", ["winter", "spring"])
def test_every_balance_closes_to_rounding(season: str, request: pytest.FixtureRequest) -> None:
    weather: Telemetry = request.getfixturevalue(season)
    start = WINTER if season == "winter" else SPRING
    plant = Plant(GreenhouseParameters(), WeatherTable(weather), float(unix_seconds(start)), seed=1)
    for name, residual in run(plant, 3 * 288).items():
        assert residual < 1e-11, name


def test_effects_and_disturbances_are_in_the_books(spring: Telemetry) -> None:
    effects = [
        HiddenEffect(name, exponent=1.3, threshold=0.1, delay_seconds=600.0) for name in [*EFFECTS, *UNCATALOGUED]
    ]
    plant = Plant(
        GreenhouseParameters(), WeatherTable(spring), float(unix_seconds(SPRING)), effects=effects,
        disturbances=Disturbances(heat=15.0, degrees_of_freedom=3.0), seed=1,
    )  # fmt: skip
    for name, residual in run(plant, 200).items():
        assert residual < 1e-11, name
    assert abs(plant.state.totals["unmodelled_heat_in"]) > 1e5


def test_balances_close_for_each_of_a_batch(winter: Telemetry) -> None:
    rng = np.random.default_rng(0)
    parameters = stack([GreenhouseParameters().varied(rng) for _ in range(5)])
    plant = Plant(parameters, WeatherTable(winter), float(unix_seconds(WINTER)), count=5, seed=1)
    for name, residual in run(plant, 100).items():
        assert residual < 1e-11, name


def test_the_lamps_electricity_and_the_boilers_heat_are_what_warms_the_greenhouse(winter: Telemetry) -> None:
    plant = Plant(GreenhouseParameters(), WeatherTable(winter), float(unix_seconds(WINTER)), seed=1)
    run(plant, 288)
    totals = plant.state.totals
    assert totals["boiler_in"] > 1e6
    assert 0.8 < totals["lamp_in"] / totals["electricity"] < 1.0
    # Pipes hold little: over a day they give what the boiler feeds.
    assert totals["pipe_heat"] == pytest.approx(totals["boiler_in"], rel=0.2)
