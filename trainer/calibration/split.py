"""Whole weeks for fitting, for choosing between models, and for the test that no step has seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.errors import IgrowError

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Split:
    """Rows of a record by what they may be used for, (n,) each; no row is in two."""

    fit: Mask
    selection: Mask
    held_out: Mask


def weeks(time: NDArray[np.datetime64]) -> NDArray[np.int64]:
    """Return the week of each row counted from the first row, (n,)."""
    number: NDArray[np.int64] = (time - time[0]).astype("timedelta64[s]").astype(np.int64) // 604_800
    return number


def split_weeks(time: NDArray[np.datetime64], fit: int, selection: int) -> Split:
    """Return the first `fit` weeks, the next `selection` weeks, and all later ones.

    Raises:
        IgrowError: nothing would be left to test on.
    """
    week = weeks(time)
    if fit < 1 or week[-1] < fit + selection:
        raise IgrowError(f"the log has {week[-1] + 1} weeks: {fit} to fit and {selection} to select leave none to test")
    return Split(week < fit, (week >= fit) & (week < fit + selection), week >= fit + selection)


def alternate_weeks(time: NDArray[np.datetime64], held_out_every: int = 4) -> Split:
    """Return every `held_out_every`-th week held out and the one before it for selection, for logs of few weeks."""
    week = weeks(time)
    held_out = week % held_out_every == held_out_every - 1
    selection = week % held_out_every == held_out_every - 2
    return Split(~held_out & ~selection, selection, held_out)
