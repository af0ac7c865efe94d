"""The mechanistic tomato at the pace of a season, fed by what a simulator says that the canopy takes up.

A simulator's balance of growth knows one crop. Here the same assimilates meet a crop of any leaf area, with a buffer
that may be full and fruit that may be young: `igrow.core.greenhouse.tomato`, in steps of hours.
"""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import Crop

HOURS = 3
"""Hours of a step."""
GROWTH_COST = 0.28
"""Carbohydrate respired for each growing into an organ, mean of fruit, leaf and stem (Heuvelink 1996)."""
INTERCEPTION = 0.7
"""Extinction of light in the canopy, 1."""
ITERATIONS = 5
REFERENCE_LEAF_AREA = 3.0
"""Leaf area index of the crop whose maintenance a simulator's growth has paid."""


def supplied(p: GreenhouseParameters, net_growth: Floats, air_temperature: Floats) -> Floats:
    """Return the carbohydrate that the reference crop took up behind a net growth in kg m-2 an hour, (B, H).

    What it kept, what its maintenance took, and what growing cost.
    """
    reference = tomato.mature_crop(p, 1.0, REFERENCE_LEAF_AREA)
    pools = (("fruit", tomato.total(reference.fruit)), ("leaf", reference.leaf), ("stem", reference.stem))
    at_25 = 3600.0 * sum(tomato.MAINTENANCE[name] * size for name, size in pools)
    idle = at_25 * np.exp(0.0693147 * (air_temperature - 25.0))
    seconds = 3600.0 * sum(size for _, size in pools)
    # Maintenance rises with growth, and growth is what net growth and maintenance leave.
    maintenance = 0.5 * idle
    for _ in range(ITERATIONS):
        growth_rate = (net_growth + maintenance).mean(axis=-1, keepdims=True) / seconds
        maintenance = idle * (1.0 - np.exp(-tomato.ACTIVITY * np.maximum(growth_rate, 0.0)))
    return np.asarray(np.maximum((1.0 + GROWTH_COST) * (net_growth + maintenance), 0.0))


def live(p: GreenhouseParameters, crop: Crop, supply: Floats, air_temperature: Floats, leaf_area: Floats) -> Crop:
    """Return the crops (B,) after hours with a supply, an air temperature and a leaf area index of (B, H) each.

    The leaves are those with which a simulator gave the supply: a crop of more takes up more light than they did.
    """
    full = supply / intercepted(leaf_area)
    hours = supply.shape[1]
    for first in range(0, hours, HOURS):
        step = slice(first, min(first + HOURS, hours))
        seconds = 3600.0 * (step.stop - step.start)
        crop = _step(p, crop, full[:, step].sum(axis=1), air_temperature[:, step].mean(axis=1), seconds)
    return crop


def intercepted(leaf_area: Floats) -> Floats:
    """Return which part of the light a canopy of a leaf area index takes, 0 to 1."""
    return np.asarray(1.0 - np.exp(-INTERCEPTION * leaf_area))


def _step(p: GreenhouseParameters, crop: Crop, full: Floats, temperature: Floats, seconds: float) -> Crop:
    """Return the crops after a step in which a canopy that takes all light would take up `full`, kg m-2."""
    light = intercepted(tomato.leaf_area_index(p, crop))
    assimilated = full * light * tomato.assimilation_share(np, crop)
    rate = tomato.rates(np, p, crop, temperature)
    # In a step of hours growth may not take more than there is.
    need = (rate.fruit + rate.leaf + rate.stem + rate.growth_respiration) * seconds
    share = np.minimum(1.0, (np.maximum(crop.buffer, 0.0) + assimilated) / np.maximum(need, 1e-12))
    rate = rate._replace(
        fruit=rate.fruit * share,
        leaf=rate.leaf * share,
        stem=rate.stem * share,
        growth_respiration=rate.growth_respiration * share,
    )
    return tomato.grow(np, p, crop, rate, assimilated, temperature, seconds)


def like(crop: Crop, count: int) -> Crop:
    """Return `count` crops equal to one."""

    def one(value: object) -> Floats:
        array = np.asarray(value, dtype=np.float64)
        return np.repeat(array.reshape(*array.shape[: array.ndim], 1), count, axis=-1)

    return Crop(*(one(value) for value in crop))


def fresh(p: GreenhouseParameters, crop: Crop) -> Floats:
    """Return the fresh fruit harvested so far, kg m-2, (B,)."""
    return np.asarray(crop.harvested / p.fruit_dry_matter)
