"""A greenhouse of another structure: its steps are short enough, and what is hidden in it acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.foreign_greenhouse import ForeignGreenhouse, begun, simulate
from benchmarks.foreign_greenhouse.crop import GROWTH_HOURS
from igrow.core.greenhouse import Disturbances, HiddenEffect, generate_weather
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.telemetry import Telemetry

QUIET = Disturbances(heat=0.0, vapour=0.0, co2=0.0)
PLANT = ForeignGreenhouse()
START = np.datetime64("2020-04-01T00:00:00")
END = START + np.timedelta64(36, "h")
WEATHER = generate_weather(START, END, seed=3, climate=WeatherClimate(PLANT.latitude, PLANT.longitude))


def run(
    *, plant: ForeignGreenhouse = PLANT, effects: tuple[HiddenEffect, ...] = (), tick: float = 60.0, seed: int = 1
) -> Telemetry:
    ((log, _),) = simulate(
        [plant], [WEATHER], START, END, [begun(plant)], seed=seed, effects=[effects], disturbances=[QUIET], tick=tick
    )
    return log


@pytest.fixture(scope="module")
def plain() -> Telemetry:
    return run()


@pytest.mark.slow
def test_steps_are_short_enough(plain: Telemetry) -> None:
    shorter = run(tick=20.0)
    bounds = {"air_temperature": 0.1, "air_humidity": 0.5, "air_co2": 8.0}
    for name, bound in bounds.items():
        assert abs(np.mean(plain[name] - shorter[name])) < bound, name


def test_the_same_seed_gives_the_same_log(plain: Telemetry) -> None:
    again, another = run(), run(seed=2)
    assert np.array_equal(plain["air_humidity"], again["air_humidity"])
    assert not np.array_equal(plain["air_humidity"], another["air_humidity"])


@pytest.mark.parametrize(
    ("effect", "quantity", "sign"),
    [
        (HiddenEffect("co2_valve_leak", 3.0), "air_co2", 1.0),
        (HiddenEffect("cover_ageing", 0.02), "par", -1.0),
        (HiddenEffect("wind_infiltration"), "air_humidity", -1.0),
        # The computer believes its sensor: what reads too much is kept too cold, and shows as before.
        (HiddenEffect("air_temperature_offset", 1.0), "rail_pipe_temperature", -1.0),
    ],
)
def test_what_is_hidden_acts(plain: Telemetry, effect: HiddenEffect, quantity: str, sign: float) -> None:
    assert sign * np.mean(run(effects=(effect,))[quantity] - plain[quantity]) > 0.0


def test_a_crop_loses_the_share_of_its_assimilation_that_is_hidden_and_no_less() -> None:
    """All of it: nothing is added to what was taken up before, but in the first step; a half: half as much."""
    noon, minutes = START + np.timedelta64(12, "h"), 30
    declines = [
        (HiddenEffect("photosynthesis_decline", loss, noon - np.timedelta64(100, "D")),) for loss in (0.0, 0.5, 1.0)
    ]
    end = noon + np.timedelta64(minutes - 5, "m")
    whole, half, none = (
        state["buffer"]
        for _, state in simulate(
            [PLANT] * 3, [WEATHER] * 3, noon, end, [begun(PLANT)] * 3, seed=1, effects=declines,
            disturbances=[QUIET] * 3, tick=60.0,
        )
    )  # fmt: skip
    assert none == pytest.approx(begun(PLANT)["buffer"] * np.exp(-minutes / (60.0 * GROWTH_HOURS)), rel=0.02)
    assert (whole - half) / (whole - none) == pytest.approx(0.5, abs=0.03)


def test_without_lamps_it_is_dark_at_night(plain: Telemetry) -> None:
    unlit = run(plant=replace(PLANT, lamp_capacity=0.0))
    night = unlit["global_radiation"] < 1.0
    assert unlit["par"][night].max() < 5.0 < plain["par"][night].max()


@pytest.mark.slow
def test_a_planted_crop_grows_and_a_grown_one_is_picked() -> None:
    end = START + np.timedelta64(8, "D")
    weather = generate_weather(START, end, seed=3, climate=WeatherClimate(PLANT.latitude, PLANT.longitude))
    (young, _), (grown, _) = simulate(
        [PLANT, PLANT], [weather, weather], START, end, [begun(PLANT, young=True), begun(PLANT)], seed=1, tick=60.0
    )
    assert young["leaf_area_index"][-1] > 1.05 * young["leaf_area_index"][0]
    assert np.diff(grown["leaf_area_index"]).min() < -0.02
