"""Gaps in a column: how long they are, and what stands in them."""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats, Mask


def interpolated(values: Floats) -> Floats:
    """Return a column with its gaps filled linearly, by the nearest value at either end, (n,); all NaN stays so."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == 0:
        return np.array(values)
    filled: Floats = np.interp(np.arange(len(values)), known, values[known])
    return filled


def held(values: Floats) -> Floats:
    """Return a column whose gaps hold the value before them, the first one at the beginning, (n,); all NaN stays so."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == 0:
        return np.array(values)
    before = np.clip(np.searchsorted(known, np.arange(len(values)), side="right") - 1, 0, None)
    filled: Floats = values[known[before]]
    return filled


def short_gaps(values: Floats, longest: int) -> Mask:
    """Tell which rows have a value or lie in a gap of at most `longest` rows between two values, (n,)."""
    good = np.isfinite(values)
    if not good.any():
        return good
    rows = np.arange(len(values))
    known = rows[good]
    before = np.clip(np.searchsorted(known, rows, side="right") - 1, 0, None)
    after = np.clip(np.searchsorted(known, rows, side="left"), None, len(known) - 1)
    short = (known[after] - known[before] - 1 <= longest) & (rows >= known[0]) & (rows <= known[-1])
    bridged: Mask = good | short
    return bridged
