"""Finds the pickings of leaves in seasons, and fits the rule by which they were made."""

from __future__ import annotations

import numpy as np
from scipy.signal import savgol_filter

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.simulator.leaf_picking import LeafPicking, certainty
from igrow.core.simulator.network import HOURS

LEAST = 0.03
"""m2 m-2: no leaf area falls by so much within an hour unless leaves are picked."""
FEW = 6
"""Pickings that a number of their own needs; later ones follow the last that has it."""
SMOOTHING_WINDOW = 999
SMOOTHING_ORDER = 2
BASES = tuple(0.5 * step for step in range(17))
"""Base temperatures that are tried, degC."""
CERTAIN, FADED = 55.0, 75.0
"""Days: on the selection seasons, later pickings are missed by more days than their mean costs."""


def smooth(values: Floats) -> Floats:
    """Return (runs, hours) as Cao et al. (2022) smooth leaf area and plant load: Savitzky-Golay, never negative."""
    window = min(SMOOTHING_WINDOW, values.shape[1] - 1 + values.shape[1] % 2)
    return np.asarray(np.maximum(savgol_filter(values, window, SMOOTHING_ORDER, axis=1), 0.0))


def followed(leaf_area: Floats) -> Floats:
    """Return the leaf area (runs, hours) that growth is to learn: as it was while the crop is young, smooth later."""
    share = certainty(np, np.arange(leaf_area.shape[1]) / HOURS, CERTAIN, FADED)
    return np.asarray(share * leaf_area + (1.0 - share) * smooth(leaf_area))


def picked_area(leaf_area: Floats) -> Floats:
    """Return what was picked in the step that ends at each hour, m2 m-2, (runs, hours).

    The growth of the hour itself is taken to be that of the hour after.
    """
    change = np.diff(leaf_area, axis=1, prepend=leaf_area[:, :1])
    growth = np.concatenate([change[:, 1:], change[:, -1:]], axis=1)
    return np.where(change < -LEAST, growth - change, 0.0)


def fit_picking(leaf_area: Floats, thermal_time: Floats, hour: Floats) -> LeafPicking | None:
    """Fit the rule to seasons of one clock, or return None where leaves are hardly ever picked.

    The hour is that of most pickings, the threshold the smallest leaf area at which any was made. For each number of
    pickings before, `ready` mistakes the fewest of the days on which the leaf area sufficed; the base temperature is
    the one with the fewest mistakes in all.

    Args:
        leaf_area, thermal_time: (runs, hours): m2 m-2, and degC d since the first hour.
        hour: (hours,) hour of the day.
    """
    gone = picked_area(leaf_area)
    done = gone > 0
    if done.sum() < FEW:
        return None
    hours = np.unique(hour)
    at = hours[np.argmax([done[:, hour == one].sum() for one in hours])]
    steps = np.flatnonzero(hour == at)
    steps = steps[steps > 0]
    picked, area = done[:, steps], leaf_area[:, steps - 1]
    if not picked.any():
        return None
    before: Integers = np.cumsum(picked, axis=1) - picked
    threshold = area[picked].min()
    numbers = [number for number in range(int(before.max()) + 1) if (picked & (before == number)).sum() >= FEW]
    if not numbers:
        return None
    best: tuple[int, float, list[float]] | None = None
    for base in BASES:
        development = (thermal_time - base * np.arange(hour.size) / HOURS)[:, steps]
        fitted = []
        for number in range(numbers[-1] + 1):
            these = (area >= threshold) & (before == number)
            fitted.append(_fewest_mistakes(development[these], picked[these]))
        mistakes = sum(count for count, _ in fitted)
        if best is None or mistakes < best[0]:
            best = (mistakes, base, [ready for _, ready in fitted])
    assert best is not None
    share = gone[:, steps] / area
    shares = [share[picked & (before == number)].mean() for number in range(numbers[-1] + 1)]
    ready, removed = np.array(best[2], dtype=np.float32), np.array(shares, dtype=np.float32)
    return LeafPicking(float(at), float(threshold), best[1], ready, removed, CERTAIN, FADED)


def _fewest_mistakes(development: Floats, picked: Mask) -> tuple[int, float]:
    """Return the fewest days told wrongly by a threshold of development, and that threshold."""
    order = np.argsort(development)
    taken = picked[order]
    # With the threshold before entry k, pickings before it and days without one from it on are mistakes.
    mistakes = np.concatenate([[0], np.cumsum(taken)]) + np.concatenate([np.cumsum(~taken[::-1])[::-1], [0]])
    k = int(mistakes[:-1].argmin())
    return int(mistakes[k]), float(development[order][k]) if k else 0.0
