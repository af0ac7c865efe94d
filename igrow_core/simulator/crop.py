"""The crop stages of the hybrid simulator: small networks, trained on the mechanistic tomato and on logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array
from igrow.core.simulator.network import Stage


@dataclass(frozen=True)
class CropStages:
    """Growth hour by hour, and the harvest day by day."""

    growth: Stage
    """Predicts `quantities.GROWTH` from `GROWTH_DRIVERS`; planning takes leaf area and fruit load from it."""
    harvest: Stage
    """Predicts `quantities.YIELD` from `HARVEST_DRIVERS`."""
    conversion: float
    """Dry matter per CO2 that the climate stage's canopy takes up, kg kg-1."""
    maintenance: float
    """Dry matter that maintenance takes at 20 degC, kg m-2 h-1."""
    covariance: NDArray[np.float64] | None = None
    """Of conversion and maintenance, (2, 2); None where this crop was never counted."""


def net_growth_rate(
    xp: Any, assimilation: Array, air_temperature: Array, conversion: Array, maintenance: Array
) -> Array:
    """Return the net growth of dry matter in kg m-2 h-1: what is assimilated, less maintenance with a Q10 of 2.

    A plan must not earn by a warm night what no light has paid for, so that its growth is a balance and no network's
    guess (Heuvelink (1996), thesis Wageningen, ch. 3: growth from assimilates less maintenance).

    Args:
        xp: the array namespace.
        assimilation: gross uptake of CO2, kg m-2 s-1.
        air_temperature: degC.
        conversion: kg of dry matter per kg of CO2.
        maintenance: kg m-2 h-1 at 20 degC.
    """
    return conversion * 3600.0 * assimilation - maintenance * xp.exp(0.0693147 * (air_temperature - 20.0))


GROWTH_DRIVERS = ("par", "air_temperature", "air_co2")
"""Hourly means of the climate."""
HARVEST_DRIVERS = ("air_temperature", "plant_load", "growth_of_day")
"""Means of the day; the last is the day's net growth in kg m-2."""
