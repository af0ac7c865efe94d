"""The greenhouses of the benchmark, and when their logs begin."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.makers import Plant
from igrow.core.greenhouse import GreenhouseParameters, generate_weather
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.site import Crop, Greenhouse, Lamps, Site
from igrow.core.telemetry import Telemetry

OTHERS_SPREAD = 0.25
"""How far other greenhouses lie from the usual one in each of their parameters, relative."""
STANDING = Crop(planting_date=datetime.date(2019, 11, 1))
"""A crop that stands since before the middle of every calibration."""


@dataclass(frozen=True)
class VirtualGreenhouse:
    """A greenhouse, and the day on which its logs begin; its model is calibrated on the eight weeks before."""

    site: Site
    plant: Plant
    start: np.datetime64
    seed: int
    """Of the log that it is calibrated on."""

    def weather(self, start: np.datetime64, end: np.datetime64, seed: int) -> Telemetry:
        """Return weather under the sun of this place."""
        return generate_weather(start, end, seed=seed, climate=WeatherClimate(self.site.latitude, self.site.longitude))


def others(count: int, first: int) -> dict[str, VirtualGreenhouse]:
    """Draw other greenhouses: each a quarter off in every parameter, half of them unlit, at any time of the year.

    Args:
        count: of greenhouses.
        first: seed of the first one.
    """
    greenhouses = {}
    for number in range(count):
        rng = np.random.default_rng(first + number)
        usual = GreenhouseParameters(latitude=float(rng.uniform(42.0, 60.0)))
        plant = usual.varied(rng, OTHERS_SPREAD)
        if number % 2:
            plant = replace(plant, lamp_capacity=0.0)
        day = np.datetime64("2020-03-01T00:00:00") + np.timedelta64(int(rng.integers(0, 300)), "D")
        name = f"greenhouse-{number}"
        greenhouses[name] = VirtualGreenhouse(site_of(name, plant), plant, day, first + 500 + number)
    return greenhouses


def site_of(name: str, plant: Plant) -> Site:
    """Return what a grower would write down of a greenhouse."""
    lamps = Lamps() if plant.lamp_capacity > 0.0 else None
    described = Greenhouse(mean_height=float(np.mean(plant.air_height)), lamps=lamps)
    return Site(name=name, latitude=plant.latitude, longitude=plant.longitude, greenhouse=described, crop=STANDING)
