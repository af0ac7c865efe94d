"""Picking of old leaves in the network variant: once a day, where the crop bears too many and the next are old enough.

Growers and Wageningen's simulator alike pick the leaves below a ripening truss at one hour of the day, up to a third
of the leaf area at once. No network of increments can learn such a jump; as a rule with fitted numbers it takes a few
lines. Humidity depends on it: a crop before a picking transpires more than the same crop after it.

Errors of the days add up from picking to picking. So the pickings are followed one by one only as long as their days
can be told; then they fade, and the leaf area is its mean between two of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array


@dataclass(frozen=True)
class LeafPicking:
    """The rule; entry n of each array is for the picking that follows n others, the last one for all later ones."""

    hour: float
    """Hour of the day at the end of the step in which leaves are picked."""
    threshold: float
    """Leaf area index (m2 m-2) from which leaves are picked."""
    base: float
    """Temperature at which development would stand still, degC."""
    ready: NDArray[np.float32]
    """Development since the first hour (degC d above `base`) before which these leaves stay."""
    share: NDArray[np.float32]
    """Share of the leaf area that is picked."""
    certain: float
    """Age of the crop in days until which pickings are followed one by one."""
    faded: float
    """Age of the crop in days from which only the mean leaf area is followed."""


def certainty(xp: Any, crop_age: Array, certain: float, faded: float) -> Array:
    """Return how far single pickings are followed at an age (days), one to zero."""
    share = (faded - crop_age) / (faded - certain)
    zero = xp.zeros_like(share)
    return xp.minimum(xp.maximum(share, zero), zero + 1.0)


def pick(
    xp: Any, rule: LeafPicking, leaf_area: Array, thermal_time: Array, crop_age: Array, hour: Array, count: Array
) -> tuple[Array, Array]:
    """Return the leaf area (m2 m-2) that is picked in one step, and the number of pickings after it.

    Args:
        leaf_area: (...,) m2 m-2 where the step begins.
        thermal_time, crop_age: (...,) degC d and days at the step's end, since the first hour.
        hour: (...,) hour of the day at the step's end.
        count: (...,) pickings so far.
    """
    development = thermal_time - rule.base * crop_age
    number = np.arange(len(rule.ready), dtype=np.float32)
    reached = xp.minimum(count, 0.0 * count + number[-1])[..., None]
    entry = xp.where(xp.abs(reached - number) < 0.5, 1.0 + 0.0 * reached, 0.0 * reached)
    ready = xp.sum(entry * rule.ready, axis=-1)
    share = xp.sum(entry * rule.share, axis=-1)
    due = (xp.abs(hour - rule.hour) < 0.5) & (leaf_area >= rule.threshold) & (development >= ready)
    done = xp.where(due, 1.0 + 0.0 * count, 0.0 * count)
    return certainty(xp, crop_age, rule.certain, rule.faded) * done * share * leaf_area, count + done
