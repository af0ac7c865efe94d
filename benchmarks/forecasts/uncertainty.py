"""How far to trust the simulator: intervals of its predictions.

Intervals come from errors that the fitted model made on days it had not seen, by lead time and by daylight
(split conformal prediction; Vovk, Gammerman and Shafer (2005), Algorithmic Learning in a Random World, ch. 4).
They promise coverage for days like those, no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import Predictor, starts_within

DAYLIGHT = 20.0
"""W m-2 of global radiation that parts day from night."""
COVERAGE = 0.9
"""Of an interval."""
_LEADS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 24.0, 48.0, 96.0, 168.0)
"""Hours at which quantiles are taken, each over the steps around it, beside the first and the last lead."""
_INDEPENDENT = {24.0: 3.0, 168.0: 1.0}
"""Length of runs in hours -> independent errors that a day is worth, for the width of intervals: within a day morning,
noon and night differ; of runs of a week the errors last from day to day, and one a day is generous."""


@dataclass(frozen=True)
class ErrorGrowth:
    """Quantiles of the error by lead time, of one quantity, in its unit."""

    hours: Floats
    """Lead times, ascending, (k,)."""
    low: Floats
    """Lower quantile of measured minus predicted, (2, k): night, day."""
    high: Floats
    """Upper quantile, (2, k)."""

    def interval(self, predicted: Floats, lead_hours: Floats, radiation: Floats) -> tuple[Floats, Floats]:
        """Return the lower and upper end of the interval around predictions; all of one shape or broadcastable."""
        day = radiation > DAYLIGHT
        low = np.where(
            day, np.interp(lead_hours, self.hours, self.low[1]), np.interp(lead_hours, self.hours, self.low[0])
        )
        high = np.where(
            day, np.interp(lead_hours, self.hours, self.high[1]), np.interp(lead_hours, self.hours, self.high[0])
        )
        return predicted + low, predicted + high


def error_growth(
    error: Floats,
    lead_hours: Floats,
    radiation: Floats,
    independent: float = float("inf"),
) -> ErrorGrowth:
    """Return the growth of errors seen on days that the model was not fitted on.

    Args:
        error: measured minus predicted, (steps, runs), NaN where not measured.
        lead_hours: of each step, (steps,).
        radiation: global, W m-2, (steps, runs).
        independent: how many independent errors they are worth. With few, the quantiles are taken further out, as
            conformal prediction does to keep its promise.
    """
    first, last = float(lead_hours[0]), float(lead_hours[-1])
    hours = np.array(sorted({first, last} | {lead for lead in _LEADS if first <= lead <= last}))
    tail = 0.5 * (1.0 - COVERAGE)
    tail = max(tail - (1.0 - tail) / independent, 0.1 * tail)
    low, high = np.zeros((2, len(hours))), np.zeros((2, len(hours)))
    for position, hour in enumerate(hours):
        near = np.abs(np.log(lead_hours / hour)) <= 0.25
        near[np.argmin(np.abs(lead_hours - hour))] = True
        chosen = error[near]
        for regime in (0, 1):
            values = chosen[np.isfinite(chosen) & ((radiation[near] > DAYLIGHT) == bool(regime))]
            if len(values) < 20:
                values = chosen[np.isfinite(chosen)]
            if len(values):
                low[regime, position], high[regime, position] = np.quantile(values, [tail, 1.0 - tail])
    return ErrorGrowth(hours, low, high)


def growth_of_runs(
    parts: Sequence[tuple[Record, Mask, Predictor]],
) -> dict[str, ErrorGrowth]:
    """Return the growth of errors on selection rows: a day from runs of a day, a week from runs as long as fit in."""
    pooled: dict[str, list[tuple[Floats, Floats, Floats, float]]] = {}
    for record, rows, predict in parts:
        for hours, every in ((24.0, 7500.0), (168.0, 29_700.0)):
            steps = round(hours * 3600.0 / record.step)
            starts = starts_within(record, rows, steps, max(1, round(every / record.step)))
            if len(starts) == 0:
                continue
            following = starts + 1 + np.arange(steps)[:, None]
            lead: Floats = np.arange(1.0, steps + 1.0) * (record.step / 3600.0)
            days = len(np.unique(record.time[following].astype("datetime64[D]")))
            keep = lead > 24.0 if hours > 24.0 else lead > 0.0
            for quantity, predicted in predict(starts, steps).items():
                if quantity in record.measured:
                    error = record.measured[quantity][following] - predicted
                    sun = record.inputs["global_radiation"][following]
                    independent = _INDEPENDENT[hours] * days
                    pooled.setdefault(quantity, []).append((lead[keep], error[keep], sun[keep], independent))
    growth = {}
    for quantity, pieces in pooled.items():
        parts_of_growth = [
            error_growth(error, lead, sun, independent=independent) for lead, error, sun, independent in pieces
        ]
        first = parts_of_growth[0]
        later = [one for one in parts_of_growth[1:] if one.hours[0] > first.hours[-1]]
        growth[quantity] = ErrorGrowth(
            np.concatenate([first.hours, *(one.hours for one in later)]),
            np.concatenate([first.low, *(one.low for one in later)], axis=1),
            np.concatenate([first.high, *(one.high for one in later)], axis=1),
        )
    return growth
