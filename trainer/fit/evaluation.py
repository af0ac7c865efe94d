"""How well the hybrid simulator predicts a log: errors over horizons, with intervals over days."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask, Times
from igrow.core.bundle import HeldOutError
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record

HORIZONS = ("1_step", "1_h", "24_h", "7_d")
"""``1_step`` and ``1_h``: the error at that distance. ``24_h`` and ``7_d``: the mean over a free run that long."""
CARRIED = ("1_h", "24_h")
"""Of the errors that a model carries."""
_RUNS = {"24_h": 86_400.0, "7_d": 604_800.0}
EVERY = 11_100.0
"""Seconds between the starts of runs; they fall on all times of the day."""

Predictor = Callable[[Integers, int], Mapping[str, Floats]]
"""`predict(starts, steps)`: what is predicted for the rows after each start, by quantity, (steps, s)."""

Model = tuple[Mapping[str, float], ActiveEffects]
"""Parameters of the climate stage, and active effects."""


@dataclass(frozen=True)
class ErrorSummary:
    """Errors of one quantity over one horizon, in its unit."""

    mae: float
    mae_low: float
    """Lower end of the 90 % interval over days (bootstrap)."""
    mae_high: float
    rmse: float
    bias: float
    persistence: float
    """MAE on the same runs of: as at the start (``1_step``, ``1_h``), as one horizon earlier (runs)."""
    runs: int


Evaluation = Mapping[str, Mapping[str, ErrorSummary]]
"""Quantity -> horizon -> errors; a horizon without a complete run is left out."""


def evaluate(
    record: Record,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    horizons: Sequence[str] = HORIZONS,
    rows: Mask | None = None,
) -> Evaluation:
    """Return the errors of free runs that start from the measured state; arguments as `errors_of`'s.

    Raises:
        IgrowError: a horizon is not known.
    """
    return summarise([errors_of(record, free_runs(record, parameters, effects), horizons, rows)])


def held_out_errors(record: Record, rows: Mask, before: Model, after: Model) -> tuple[HeldOutError, ...]:
    """Return the errors of one model beside those of another, on rows that no fit saw, (n,)."""
    old, new = (evaluate(record, *one, CARRIED, rows) for one in (before, after))
    return tuple(
        HeldOutError(
            quantity,
            horizon,
            old[quantity][horizon].mae,
            summary.mae,
            QUANTITIES[quantity].unit,
            summary.persistence if np.isfinite(summary.persistence) else None,
        )
        for quantity, by_horizon in new.items()
        for horizon, summary in by_horizon.items()
        if horizon in old.get(quantity, {})
    )


def free_runs(record: Record, parameters: Mapping[str, float], effects: ActiveEffects) -> Predictor:
    """Return runs of the climate stage from the measured state, driven by what the actuators did."""
    states = records.observe(record, parameters, effects)

    def predict(starts: Integers, steps: int) -> Mapping[str, Floats]:
        return records.free_run(record, states, starts, steps, parameters, effects)

    return predict


@dataclass(frozen=True)
class Errors:
    """Errors of runs of one quantity over one horizon."""

    error: Floats
    """Predicted minus measured, (steps, s); the horizon's last step alone for distances."""
    naive: Floats
    """The same of persistence."""
    day: Times
    """On which each run starts, (s,)."""


def errors_of(
    record: Record,
    predict: Predictor,
    horizons: Sequence[str],
    rows: Mask | None = None,
    *,
    begin: Mask | None = None,
    every: float = EVERY,
) -> dict[tuple[str, str], Errors]:
    """Return the errors of runs by (quantity, horizon).

    Args:
        record: the log.
        predict: the model.
        horizons: of `HORIZONS`.
        rows: a run counts only if all its rows are among these, (n,); None: all.
        begin: rows at which runs may start, (n,); None: all.
        every: seconds between starts.

    Raises:
        IgrowError: a horizon is not known.
    """
    allowed = np.ones(len(record), dtype=bool) if rows is None else rows
    result: dict[tuple[str, str], Errors] = {}
    for horizon in horizons:
        if horizon not in HORIZONS:
            raise IgrowError(f"horizon {horizon!r} is not known: {', '.join(HORIZONS)}")
        steps = horizon_steps(record, horizon)
        starts = starts_within(record, allowed, steps, max(1, round(every / record.step)))
        if begin is not None:
            starts = starts[begin[starts]]
        if len(starts) == 0:
            continue
        following = starts + 1 + np.arange(steps)[:, None]
        for quantity, predicted in predict(starts, steps).items():
            if quantity not in record.measured:
                continue
            measured = record.measured[quantity]
            error = predicted - measured[following]
            if horizon in _RUNS:
                earlier = following - steps
                naive = np.where(earlier >= 0, measured[np.maximum(earlier, 0)], np.nan) - measured[following]
            else:
                error, naive = error[-1:], (measured[starts] - measured[following[-1]])[None]
            if np.isfinite(error).any():
                result[quantity, horizon] = Errors(error, naive, record.time[starts].astype("datetime64[D]"))
    return result


def summarise(parts: Sequence[Mapping[tuple[str, str], Errors]], seed: int = 0) -> Evaluation:
    """Return the summary of errors from one model or several (say, one for each week), pooled."""
    result: dict[str, dict[str, ErrorSummary]] = {}
    for quantity, horizon in dict.fromkeys(key for part in parts for key in part):
        found = [part[quantity, horizon] for part in parts if (quantity, horizon) in part]
        result.setdefault(quantity, {})[horizon] = _summary(
            np.concatenate([one.error for one in found], axis=1),
            np.concatenate([one.naive for one in found], axis=1),
            np.concatenate([one.day for one in found]),
            seed,
        )
    return result


def horizon_steps(record: Record, horizon: str) -> int:
    """Return the rows that a horizon spans."""
    return {"1_step": 1, "1_h": max(1, round(3600.0 / record.step))}.get(horizon) or round(_RUNS[horizon] / record.step)


def starts_within(record: Record, allowed: Mask, steps: int, every: int) -> Integers:
    """Return start rows, (s,), `every` apart, from which a complete run of `steps` stays among `allowed` rows, (n,)."""
    starts = records.complete_starts(record, steps, every)
    outside = np.concatenate([[0], np.cumsum(~allowed)])
    return np.asarray(starts[outside[starts + steps + 1] - outside[starts] == 0])


def _summary(error: Floats, naive: Floats, day: Times, seed: int) -> ErrorSummary:
    """Summarise errors (steps, s) of runs that start on `day` (s,)."""
    known = np.isfinite(error)
    size = np.where(known, np.abs(error), 0.0).sum(axis=0)
    number = known.sum(axis=0)
    _, index = np.unique(day, return_inverse=True)
    day_size = np.bincount(index, weights=size)
    day_number = np.bincount(index, weights=number)
    draws = np.random.default_rng(seed).integers(0, len(day_size), size=(400, len(day_size)))
    means = day_size[draws].sum(axis=1) / np.maximum(day_number[draws].sum(axis=1), 1.0)
    low, high = np.quantile(means, [0.05, 0.95])
    return ErrorSummary(
        mae=float(size.sum() / number.sum()),
        mae_low=float(low),
        mae_high=float(high),
        rmse=float(np.sqrt(np.nanmean(error**2))),
        bias=float(np.nanmean(error)),
        persistence=float(np.nanmean(np.abs(naive))) if np.isfinite(naive).any() else float("nan"),
        runs=int(error.shape[1]),
    )
