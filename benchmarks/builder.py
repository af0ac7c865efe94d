"""A builder's greenhouses: some that share what they learned and new ones that begin, for the benchmarks of sharing."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from igrow.core.greenhouse import GreenhouseParameters
from igrow.core.site import Greenhouse, Lamps, Site

START = np.datetime64("2020-02-10T00:00:00")
BUILDER, OWN = 0.2, 0.06
"""How far the builder's greenhouses lie from the described one, and each of them from the others, relative."""
SHARED_DAYS = 28
QUANTITIES = ("air_temperature", "air_humidity", "air_co2")


@dataclass(frozen=True)
class Asked:
    """What a command asked for."""

    shared: list[GreenhouseParameters]
    new: list[GreenhouseParameters]
    seed: int
    """The next ones are free for weather and noise."""


def asked_for(about: str | None, *, shared: int, new: int, seed: int) -> Asked:
    """Return the greenhouses of `--shared N --new N --seed N`, with these defaults; `about` is the command's help."""
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=int, default=shared, help=f"greenhouses that share (default {shared})")
    parser.add_argument("--new", type=int, default=new, help=f"greenhouses that begin (default {new})")
    parser.add_argument("--seed", type=int, default=seed)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    builder = GreenhouseParameters().varied(rng, BUILDER)
    plants = [builder.varied(rng, OWN) for _ in range(options.shared + options.new)]
    return Asked(plants[: options.shared], plants[options.shared :], options.seed)


def site_of(plant: GreenhouseParameters) -> Site:
    """Return what a grower would write down."""
    described = Greenhouse(mean_height=float(np.mean(plant.air_height)), lamps=Lamps())
    return Site(name="new", latitude=plant.latitude, longitude=plant.longitude, greenhouse=described)
