"""Days for fitting and days that no step sees: whole local days, in blocks of two among every eight.

A period of eight days lets the held-out days run through all weekdays; a block of two lets 24 h free runs start
at every hour of its first day.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid.record import Record

PERIOD, HELD_OUT = 8, 2
_FIRST = 3
"""Day of the period with which the held-out block begins: a log's first days are for fitting."""


@dataclass(frozen=True)
class Split:
    """Days of a record."""

    day: NDArray[np.int64]
    """Index of the local solar day of each row, from 0, (n,)."""
    fit: NDArray[np.bool_]
    """Days for fitting, (days,)."""

    @property
    def days(self) -> int:
        """Number of days touched."""
        return len(self.fit)

    @property
    def fit_rows(self) -> NDArray[np.bool_]:
        """Rows that may be fitted, (n,)."""
        rows: NDArray[np.bool_] = self.fit[self.day]
        return rows


def split_days(record: Record, longitude: float) -> Split:
    """Split a record by local solar days; a log of less than eight days is all for fitting."""
    seconds = record.time.astype("datetime64[s]").astype(np.int64) + int(240.0 * longitude)
    day = seconds // 86_400
    day -= day[0]
    days = int(day[-1]) + 1
    phase = np.arange(days) % PERIOD
    held = (phase >= _FIRST) & (phase < _FIRST + HELD_OUT)
    if days < PERIOD:
        held[:] = False
    return Split(day, ~held)


def held_out_starts(
    split: Split, record: Record, steps: int, every: int, usable_starts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pick, of rows that can be started from, those whose whole run of `steps` rows lies on held-out days."""
    held = ~split.fit_rows
    seen = np.concatenate([[0], np.cumsum(~held)])
    inside = usable_starts[usable_starts + steps < len(record)]
    whole = seen[inside + steps] - seen[inside] == 0
    chosen: NDArray[np.int64] = inside[whole]
    return chosen[:: max(1, every)]
