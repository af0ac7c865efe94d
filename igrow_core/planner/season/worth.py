"""Marginal values (co-states) of the crop's state, and the day's income by them.

What one more kilogram of leaf, of buffer or of fruit of an age is worth at the end of the season, under the season's
strategy: the derivative of its net profit, by central differences. A day is then worth what it does to the crop, and
what it harvests: growth that a full buffer cannot use earns nothing, warmth earns what ripening brings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats, Times
from igrow.core.economics import local_days, product_price
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import STAGES, Crop
from igrow.core.planner.objective import DISBELIEF
from igrow.core.planner.season.course import Season, run_season
from igrow.core.planner.season.crop import fresh, like, live, supplied
from igrow.core.planner.season.strategy import Strategy
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Site

STEP = 0.1
"""Relative step of the differences; a pool that is empty takes a gram."""
LEAST = 1e-3


@dataclass(frozen=True)
class MarginalValues:
    """EUR for each kg of carbohydrate."""

    buffer: float
    leaf: float
    fruit: Floats
    """By stage from the youngest on, (20,)."""


def marginal_values(season: Season, strategy: Strategy, genes: NDArray[np.float32], crop: Crop) -> MarginalValues:
    """Return what the state of one crop is worth under one strategy (G,) until the end of the season."""
    steps = [("buffer", 0), ("leaf", 0), *(("fruit", stage) for stage in range(STAGES))]
    plants = like(crop, 2 * len(steps))
    size = np.empty(len(steps))
    for column, (name, stage) in enumerate(steps):
        pool = getattr(plants, name)
        row = pool[stage] if name == "fruit" else pool
        size[column] = max(STEP * row[0], LEAST)
        row[2 * column] += size[column]
        row[2 * column + 1] -= min(size[column], row[0])
        size[column] += min(size[column], row[2 * column] - size[column])
    profit = run_season(season, strategy, genes[None], plants).balance.net_profit
    slope = (profit[0::2] - profit[1::2]) / size
    return MarginalValues(float(slope[0]), float(slope[1]), slope[2:])


@dataclass(frozen=True)
class CropWorth:
    """The income of a horizon by what it does to one crop; a worth of `objective.Objective`."""

    site: Site
    plant: GreenhouseParameters
    crop: Crop
    """As it stands when the horizon begins."""
    values: MarginalValues

    def income(self, outcome: Outcome, time: Times) -> Floats:
        """Return EUR m-2 over the horizon, (M, B)."""
        members, count, hours = outcome.net_growth.shape
        grown = outcome.net_growth * np.clip(1.0 - DISBELIEF * outcome.outside, 0.0, 1.0)
        flat = (members * count, hours)
        air, leaves = outcome.air_temperature.reshape(flat), outcome.leaf_area_index.reshape(flat)
        before = like(self.crop, members * count)
        after = live(self.plant, before, supplied(self.plant, grown.reshape(flat), air), air, leaves)
        price = product_price(self.site.prices, local_days(time, self.site.time_zone), self.site.crop.brix).mean()
        gained = (
            price * (fresh(self.plant, after) - fresh(self.plant, before))
            + self.values.buffer * (after.buffer - before.buffer)
            + self.values.leaf * (after.leaf - before.leaf)
            + self.values.fruit @ (after.fruit - before.fruit)
        )
        return np.asarray(gained.reshape(members, count))
