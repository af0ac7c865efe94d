"""Parameters fitted to the 24 h free runs of the fit days: what `recalibrated` and `corrected` mean in the tables.

A forecast is judged by its free run, so the parameters that are shipped are those that serve it: Gauss-Newton under
the prior, with a robust loss, errors counted for what they are worth (a correlation time of twelve hours).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.splits import DaySplit as Split
from igrow.trainer.diagnosis import linearisation
from igrow.trainer.diagnosis.linearisation import DayRuns, DivergenceError, Floats, Linearisation
from igrow.trainer.diagnosis.prior import Prior

SPREADS = np.array([0.5, 3.0, 35.0])
"""Errors that weigh the quantities against each other: K, %, ppm."""
CORRELATION = 43_200.0
"""Seconds over which errors of a free run hang together."""
ROBUST = 2.0
"""Errors beyond so many spreads count linearly (Huber)."""
ITERATIONS = 12


def fit(
    record: Record,
    runs: DayRuns,
    split: Split,
    prior: Prior,
    effects: ActiveEffects,
    start: Mapping[str, float] | None = None,
    added: Mapping[str, Floats] | None = None,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return parameters and their standard deviations.

    Args:
        record: of the log.
        runs: its day-long runs.
        split: only fit days count.
        prior: of the parameters.
        effects: active, held.
        start: where to begin (None: the prior's mean).
        added: further fluxes by channel, (n,).

    Raises:
        DivergenceError: the model runs out of all bounds where the fit begins.
    """
    line = linearisation.linearise(record, runs, prior.clip(start or prior.mean), effects, added)
    cost = _cost(line, split, prior)
    normal = prior.precision
    for _ in range(ITERATIONS):
        columns = linearisation.parameter_columns(line, prior.names, prior.spread)
        weight = _weights(line, split)
        slopes = (columns * weight).reshape(len(columns), -1)
        normal = slopes @ slopes.T + prior.precision
        shift = np.array([line.parameters[name] - prior.mean[name] for name in prior.names])
        gradient = slopes @ (line.errors * weight).ravel() + prior.precision @ shift
        improved = False
        for damping in (0.0, 0.3, 3.0):
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
            moved = prior.clip(
                {name: line.parameters[name] + float(part) for name, part in zip(prior.names, step, strict=True)}
            )
            try:
                trial = linearisation.linearise(record, runs, moved, effects, added)
            except DivergenceError:
                continue
            after = _cost(trial, split, prior)
            if after < cost:
                improved = cost - after > 1e-3 * cost
                line, cost = trial, after
                break
        if not improved:
            break
    deviation = np.sqrt(np.diag(np.linalg.inv(normal)))
    return dict(line.parameters), {name: float(one) for name, one in zip(prior.names, deviation, strict=True)}


def _weights(line: Linearisation, split: Split) -> Floats:
    """Return the root weight of every error, (3, r, steps)."""
    size = np.abs(line.errors) / SPREADS[:, None, None]
    huber = np.where(size > ROBUST, ROBUST / np.maximum(size, 1e-9), 1.0)
    worth = line.record.step / CORRELATION
    counted = line.runs.weight & split.fit[line.runs.day][None, :, None]
    weights: Floats = np.where(counted, np.sqrt(huber * worth), 0.0) / SPREADS[:, None, None]
    return weights


def _cost(line: Linearisation, split: Split, prior: Prior) -> float:
    size = np.abs(line.errors) / SPREADS[:, None, None]
    loss = np.where(size > ROBUST, ROBUST * (2.0 * size - ROBUST), size**2)
    counted = line.runs.weight & split.fit[line.runs.day][None, :, None]
    shift = np.array([line.parameters[name] - prior.mean[name] for name in prior.names])
    worth = line.record.step / CORRELATION
    return float(worth * loss[counted].sum() + shift @ prior.precision @ shift)
