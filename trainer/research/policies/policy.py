"""A learnt policy: from a day's forecast and the crop's state straight to the day's setpoints.

As in Cao et al. (2022) it sees 76 numbers and gives 96, four setpoints for each of 24 hours. It costs one run of
a small network, so that the search may start from it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats
from igrow.core.planner.objective import Objective
from igrow.core.planner.template import BY_HOUR, STEPS, Setpoints
from igrow.core.quantities import SETPOINTS, WEATHER
from igrow.core.site import Site

HOURS = 24
PAPER_SETPOINTS = ("heating_setpoint", "co2_setpoint", "lamp_on", "irrigation_on")
"""The four that the policies of Cao et al. (2022) choose."""
PAPER_COLUMNS = [SETPOINTS.index(name) for name in PAPER_SETPOINTS]
"""Where they stand among all."""
FORECAST = {"outdoor_temperature": (10.0, 10.0), "outdoor_humidity": (75.0, 20.0), "global_radiation": (150.0, 250.0)}
"""Weather that the policy sees for each hour, with the offset and scale that bring it near to -1 to 1."""
PRESENT = {"air_temperature": (20.0, 5.0), "leaf_area_index": (3.0, 1.0), "plant_load": (300.0, 200.0)}
"""State that it sees, with offset and scale."""
OBSERVATIONS = HOURS * len(FORECAST) + len(PRESENT) + 1
"""76: the last one is the price of growth."""
ACTIONS = HOURS * len(PAPER_SETPOINTS)
"""96: hour by hour, -1 for the lower limit of a setpoint and 1 for the upper one."""


def observe(site: Site, present: Mapping[str, Floats], forecast: Floats, start: np.datetime64) -> NDArray[np.float32]:
    """Return what the policy sees, (B, 76).

    Args:
        site: for the price of growth.
        present: quantities of `PRESENT`, each (B,); one that is missing counts as its offset.
        forecast: (B, 24, 6), hourly means in the registry's order.
        start: UTC time of the first hour.
    """
    count = len(forecast)
    parts = [(forecast[:, :, WEATHER.index(name)] - offset) / scale for name, (offset, scale) in FORECAST.items()]
    for name, (offset, scale) in PRESENT.items():
        value = np.broadcast_to(present.get(name, np.asarray(offset)), count)
        parts.append(((value - offset) / scale)[:, None])
    time = start.astype("datetime64[s]") + np.arange(HOURS) * np.timedelta64(3600, "s")
    price = Objective(site, time).growth_price().mean()
    parts.append(np.full((count, 1), (price - 2.0) / 1.0))
    return np.concatenate(parts, axis=1).astype(np.float32)


def to_setpoints(site: Site, actions: NDArray[np.float32]) -> Setpoints:
    """Return `PAPER_SETPOINTS` (B, 24, 4) of actions (B, 96), -1 to 1, within the limits; lamps are on or off."""
    low = np.array([site.limits[name].low for name in PAPER_SETPOINTS])
    high = np.array([site.limits[name].high for name in PAPER_SETPOINTS])
    shape = (len(actions), HOURS, len(PAPER_SETPOINTS))
    share = (np.clip(actions.astype(np.float64), -1.0, 1.0).reshape(shape) + 1.0) / 2.0
    setpoints = low + share * (high - low)
    for name in BY_HOUR:
        column = PAPER_SETPOINTS.index(name)
        setpoints[..., column] = np.round(setpoints[..., column] / STEPS[name]) * STEPS[name]
    return np.asarray(setpoints)


def chosen(site: Site, setpoints: Setpoints, recipe: Setpoints) -> Setpoints:
    """Return all setpoints (..., H, S): of `PAPER_SETPOINTS` (..., H, 4) those that the site's plans choose, else the
    recipe's, (H, S).

    A policy sees no slab, and its simulator none either: it would water at random.
    """
    asked = np.broadcast_to(recipe, (*setpoints.shape[:-1], len(SETPOINTS))).copy()
    free = [name in site.setpoints and name in site.planning.optimise for name in PAPER_SETPOINTS]
    asked[..., PAPER_COLUMNS] = np.where(free, setpoints, asked[..., PAPER_COLUMNS])
    return asked
