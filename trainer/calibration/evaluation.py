"""How well the hybrid simulator predicts a log: errors over horizons, with intervals over days."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.disturbance import DisturbanceModel, expected_fluxes, missing_fluxes
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.calibration.posterior import Posterior

Floats = NDArray[np.float64]

HORIZONS = ("1_step", "1_h", "24_h", "7_d")
"""``1_step`` and ``1_h``: the error at that distance. ``24_h`` and ``7_d``: the mean over a free run that long."""
_RUNS = {"24_h": 86_400.0, "7_d": 604_800.0}


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
    parameters: Posterior | Mapping[str, float],
    effects: ActiveEffects,
    horizons: Sequence[str] = HORIZONS,
    rows: NDArray[np.bool_] | None = None,
    *,
    added: Mapping[str, Floats] | None = None,
    disturbance: DisturbanceModel | None = None,
    every: float = 11_100.0,
    seed: int = 0,
) -> Evaluation:
    """Return the errors of free runs that start from the measured state.

    Args:
        record: the log.
        parameters: by name.
        effects: the active effects.
        horizons: of `HORIZONS`.
        rows: a run counts only if all its rows are among these, (n,); None: all.
        added: further fluxes by channel, (n,) (a learned remainder).
        disturbance: how the fluxes that were missing before a start go on after it; None: they are forgotten.
        every: seconds between starts; the default makes them fall on all times of the day.
        seed: of the bootstrap over days.

    Raises:
        IgrowError: a horizon is not known.
    """
    runs = run_errors(record, parameters, effects, horizons, rows, added=added, disturbance=disturbance, every=every)
    return summarise([runs], seed)


@dataclass(frozen=True)
class Errors:
    """Errors of runs of one quantity over one horizon."""

    error: Floats
    """Predicted minus measured, (steps, s); the horizon's last step alone for distances."""
    naive: Floats
    """The same of persistence."""
    day: NDArray[np.datetime64]
    """On which each run starts, (s,)."""


def run_errors(
    record: Record,
    parameters: Posterior | Mapping[str, float],
    effects: ActiveEffects,
    horizons: Sequence[str] = HORIZONS,
    rows: NDArray[np.bool_] | None = None,
    *,
    begin: NDArray[np.bool_] | None = None,
    added: Mapping[str, Floats] | None = None,
    disturbance: DisturbanceModel | None = None,
    every: float = 11_100.0,
) -> dict[tuple[str, str], Errors]:
    """Return the errors of free runs by (quantity, horizon); arguments as `evaluate`'s.

    `begin` are the rows at which runs may start, (n,); None: all.
    """
    values = parameters.values if isinstance(parameters, Posterior) else parameters
    states = records.observe(record, values, effects)
    missing = missing_fluxes(record, values, effects, added) if disturbance is not None else None

    def predict(starts: NDArray[np.int64], steps: int) -> Mapping[str, Floats]:
        fluxes = run_fluxes(record, values, effects, starts, steps, added, disturbance, missing)
        return records.free_run(record, states, starts, steps, values, effects, fluxes)

    return errors_of(record, predict, horizons, rows, begin=begin, every=every)


def errors_of(
    record: Record,
    predict: Callable[[NDArray[np.int64], int], Mapping[str, Floats]],
    horizons: Sequence[str],
    rows: NDArray[np.bool_] | None,
    *,
    begin: NDArray[np.bool_] | None = None,
    every: float = 11_100.0,
) -> dict[tuple[str, str], Errors]:
    """Return the errors of any predictor: `predict(starts, steps)` gives (steps, s) by quantity."""
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


def run_fluxes(
    record: Record,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    starts: NDArray[np.int64],
    steps: int,
    added: Mapping[str, Floats] | None,
    disturbance: DisturbanceModel | None,
    missing: Mapping[str, Floats] | None = None,
) -> dict[str, Floats]:
    """Return all fluxes beside the balances that runs from `starts` take along: known ones and expected ones.

    `missing` are the missing fluxes, where they are at hand. By channel, (n,) or (steps, s).
    """
    fluxes = dict(added or {})
    if disturbance is not None:
        seen = missing or missing_fluxes(record, parameters, effects, added)
        ahead = starts + np.arange(steps)[:, None]
        for channel, flux in expected_fluxes(record, seen, starts, steps, disturbance).items():
            fluxes[channel] = flux + (fluxes[channel][ahead] if channel in fluxes else 0.0)
    return fluxes


def horizon_steps(record: Record, horizon: str) -> int:
    """Return the rows that a horizon spans."""
    return {"1_step": 1, "1_h": max(1, round(3600.0 / record.step))}.get(horizon) or round(_RUNS[horizon] / record.step)


def starts_within(record: Record, allowed: NDArray[np.bool_], steps: int, every: int) -> NDArray[np.int64]:
    """Return start rows, `every` apart, from which a complete run of `steps` stays among the `allowed` rows."""
    starts = records.complete_starts(record, steps, every)
    outside = np.concatenate([[0], np.cumsum(~allowed)])
    chosen: NDArray[np.int64] = starts[outside[starts + steps + 1] - outside[starts] == 0]
    return chosen


def _summary(error: Floats, naive: Floats, day: NDArray[np.datetime64], seed: int) -> ErrorSummary:
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
