"""Rows for fitting, and rows that no step sees: by days within a log, by weeks along it.

Days: whole local days, in blocks of two among every eight. A period of eight days lets the held-out days run through
all weekdays; a block of two lets 24 h free runs start at every hour of its first day.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from igrow.core import sun
from igrow.core.arrays import Integers, Mask, Times
from igrow.core.simulator.hybrid.record import Record

PERIOD, HELD_OUT = 8, 2
_FIRST = 3
"""Day of the period with which the held-out block begins: a log's first days are for fitting."""


@dataclass(frozen=True)
class DaySplit:
    """Days of a record."""

    day: Integers
    """Index of the local solar day of each row, from 0, (n,)."""
    fit: Mask
    """Days for fitting, (days,)."""

    @property
    def days(self) -> int:
        """Number of days touched."""
        return len(self.fit)

    @property
    def fit_rows(self) -> Mask:
        """Rows that may be fitted, (n,)."""
        return np.asarray(self.fit[self.day])


def split_days(record: Record, longitude: float) -> DaySplit:
    """Split a record by local solar days; a log of less than eight days is all for fitting."""
    day = sun.solar_day(record.time, longitude)
    day -= day[0]
    days = int(day[-1]) + 1
    return DaySplit(day, ~_held_out(days))


def _held_out(days: int) -> Mask:
    phase = np.arange(days) % PERIOD
    held = (phase >= _FIRST) & (phase < _FIRST + HELD_OUT)
    return held & (days >= PERIOD)


def folds(split: DaySplit) -> tuple[DaySplit, ...]:
    """Return the splits of a cross-validation, the given one of `split_days` first: each day is held out in one."""
    held = (np.roll(_held_out(split.days + PERIOD), HELD_OUT * turn)[PERIOD:] for turn in range(PERIOD // HELD_OUT))
    turned = [DaySplit(split.day, ~one) for one in held]
    return (split, *(turned if split.fit.all() else turned[1:]))


def weeks(time: Times) -> Integers:
    """Return the week of each row counted from the first row, (n,)."""
    return np.asarray((time - time[0]).astype("timedelta64[s]").astype(np.int64) // 604_800)


def held_out_weeks(time: Times) -> Mask:
    """Return the rows of every fourth week, (n,), for logs of few weeks."""
    return np.asarray(weeks(time) % 4 == 3)
