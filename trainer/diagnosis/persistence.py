"""Does a model fit at all? It must at least be better than yesterday's readings at the same hour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from igrow.trainer.diagnosis.result import Diagnosis

_DAY = 86_400.0


@dataclass(frozen=True)
class Misfit:
    """A quantity that a model predicts no better than yesterday's readings do."""

    quantity: str
    error: float
    """Mean absolute error of the model a day ahead on unseen days."""
    persistence: float
    """The same of yesterday's readings."""


def persistence_errors(result: Diagnosis) -> Mapping[str, float]:
    """Return the mean absolute error of yesterday's readings on the unseen days, by quantity that was judged."""
    if result.evidence is None:
        return {}
    record, split = result.evidence.log.record, result.evidence.log.split
    rows = round(_DAY / record.step)
    unseen = ~split.fit_rows[rows:]
    errors = {}
    for quantity in result.errors:
        values = record.measured[quantity]
        change = np.abs(values[rows:] - values[:-rows])[unseen]
        if np.isfinite(change).any():
            errors[quantity] = float(np.nanmean(change))
    return errors


def misfits(result: Diagnosis) -> list[Misfit]:
    """Return the quantities that the model which stands predicts no better than yesterday's readings do."""
    stage, found = "deployed" if result.verdict == "nothing" else "corrected", []
    for quantity, yesterday in persistence_errors(result).items():
        error = result.errors[quantity].get("24_h", {}).get(stage)
        if error is not None and error >= yesterday:
            found.append(Misfit(quantity, error, yesterday))
    return found
