"""The mechanistic greenhouse as the planner's simulator: candidates are independent, and the plan comes true."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.greenhouse import GreenhouseParameters, generate_weather, recipe
from igrow.core.planner.plant_simulator import PlantSimulator
from igrow.core.quantities import SETPOINTS

START = np.datetime64("2020-01-11T06:00:00")
HOURS = 4


def schedule() -> np.ndarray:
    return np.array([[recipe(START + np.timedelta64(h, "h"))[name] for name in SETPOINTS] for h in range(HOURS)])


@pytest.fixture
def plant() -> PlantSimulator:
    weather = generate_weather(START, START + np.timedelta64(2, "D"), seed=1)
    return PlantSimulator(GreenhouseParameters(), weather, START)


def test_what_the_candidates_do_comes_true_when_one_is_followed(plant: PlantSimulator) -> None:
    warm = schedule() + np.array([4.0, 0.0, 0.0, 0.0])
    empty = np.zeros((HOURS, 6))
    both = plant.simulate({}, empty, np.stack([schedule(), warm]), START)
    assert both.heat[0, 1].sum() > both.heat[0, 0].sum() + 0.2
    assert both.air_temperature.shape == (1, 2, HOURS)
    true = plant.follow(warm)
    np.testing.assert_allclose(true.heat[0, 0], both.heat[0, 1], rtol=1e-9)
    np.testing.assert_allclose(true.net_growth[0, 0], both.net_growth[0, 1], rtol=1e-9)
    assert plant.time == START + np.timedelta64(HOURS, "h")


def test_trying_candidates_does_not_move_the_greenhouse(plant: PlantSimulator) -> None:
    before = plant.measurements()
    plant.simulate({}, np.zeros((HOURS, 6)), np.repeat(schedule()[None], 3, axis=0), START)
    assert plant.measurements() == before
