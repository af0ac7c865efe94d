"""The greenhouses of the benchmark, and when their logs begin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.cases import SEASONS
from igrow_core.greenhouse import GreenhouseParameters, generate_weather
from igrow_core.greenhouse.weather import WeatherClimate
from igrow_core.site import Greenhouse, Lamps, Site
from igrow_core.telemetry import Telemetry

ELSEWHERE_SEED, LEARNING_SEED = 60_000, 80_000
"""Of houses that cases are drawn for, and of those that what is usual is learned from."""
ELSEWHERE_SPREAD = 0.25
"""How far houses elsewhere lie from the usual one in each of their parameters, relative."""


@dataclass(frozen=True)
class House:
    """A greenhouse, and the day on which its logs begin; its model is calibrated on the eight weeks before."""

    site: Site
    plant: GreenhouseParameters
    start: np.datetime64
    seed: int
    """Of the log that it is calibrated on."""

    def weather(self, start: np.datetime64, end: np.datetime64, seed: int) -> Telemetry:
        """Return weather under the sun of this place."""
        return generate_weather(start, end, seed=seed, climate=WeatherClimate(self.site.latitude, self.site.longitude))


def of_seasons() -> dict[str, House]:
    """Return the one greenhouse that most of the benchmark is about, by season."""
    site = Site(name="benchmark", latitude=52.0, longitude=4.5, greenhouse=Greenhouse(mean_height=5.8))
    return {
        season: House(site, GreenhouseParameters(), np.datetime64(f"{day}T00:00:00"), 77 + number)
        for number, (season, day) in enumerate(SEASONS.items())
    }


def elsewhere(count: int, first: int = ELSEWHERE_SEED) -> dict[str, House]:
    """Draw other greenhouses: each a quarter off in every parameter, half of them unlit, at any time of the year.

    Args:
        count: of houses.
        first: seed of the first one.
    """
    houses = {}
    for number in range(count):
        rng = np.random.default_rng(first + number)
        lit = number % 2 == 0
        usual = GreenhouseParameters(latitude=float(rng.uniform(42.0, 60.0)))
        plant = replace(usual.varied(rng, ELSEWHERE_SPREAD), lamp_capacity=usual.lamp_capacity if lit else 0.0)
        described = Greenhouse(mean_height=float(np.mean(plant.air_height)), lamps=Lamps() if lit else None)
        day = np.datetime64("2020-03-01T00:00:00") + np.timedelta64(int(rng.integers(0, 300)), "D")
        site = Site(name=f"house-{number}", latitude=plant.latitude, longitude=plant.longitude, greenhouse=described)
        houses[site.name] = House(site, plant, day, first + 500 + number)
    return houses
