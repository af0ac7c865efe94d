"""Does a model fit at all? It must at least be better than yesterday's readings at the same hour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from igrow.trainer.diagnosis.freerun import LogDays

_DAY = 86_400.0


def persistence_errors(log: LogDays, quantities: Iterable[str]) -> Mapping[str, float]:
    """Return the mean absolute error of yesterday's readings on the unseen days, by quantity that has any."""
    record = log.record
    rows = round(_DAY / record.step)
    unseen = ~log.split.fit_rows[rows:]
    errors = {}
    for quantity in quantities:
        values = record.measured[quantity]
        change = np.abs(values[rows:] - values[:-rows])[unseen]
        if np.isfinite(change).any():
            errors[quantity] = float(np.nanmean(change))
    return errors
