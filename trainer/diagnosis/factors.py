"""The few directions in which logs differ, chosen by the largest marginal likelihood.

What a log says of a list of amplitudes a is a normal likelihood, score @ a - a @ information @ a / 2. With
a = loadings @ z, and z standard normal and new in every log, z can be integrated out; the loadings are those that make
all logs together likeliest. This is factor analysis (Bishop 2006, Pattern Recognition and Machine Learning, sections
3.5 and 12.2) in which every log has its own, known noise. Scatter of regressions (principal components) would instead
hold what no log can tell apart, and did worse by far in greenhouses that nothing was learned from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from igrow.trainer.diagnosis.gram import Floats

SEEN = 1e-6
"""Share of the largest eigenvalue of the pooled information below which a direction is not looked at."""
TURNS = 150
"""Iterations of the ascent at most."""


@dataclass(frozen=True)
class LogLikelihood:
    """What a log says of the amplitudes, up to a constant."""

    information: Floats
    """(k, k), zero for an amplitude that the log cannot show."""
    score: Floats
    """(k,), its gradient where all amplitudes are zero."""


def evidence(loadings: Floats, logs: Sequence[LogLikelihood]) -> float:
    """Return the log marginal likelihood of logs over that of amplitudes that are all zero (Bishop eq. 3.86).

    Args:
        loadings: (k, count).
        logs: each with k amplitudes.
    """
    return sum(_evidence(loadings, one)[0] for one in logs)


def loadings(logs: Sequence[LogLikelihood], count: int) -> Floats:
    """Return directions at their usual size, (k, count), the largest first.

    A weak prior keeps each below about what a log can see: one unit where the pooled information is one.
    """
    pooled = np.zeros_like(logs[0].information)
    for one in logs:
        pooled += one.information / len(logs)
    basis = _seen(pooled)
    reduced = [LogLikelihood(basis.T @ one.information @ basis, basis.T @ one.score) for one in logs]
    shape = (basis.shape[1], min(count, basis.shape[1]))

    def descent(flat: Floats) -> tuple[float, Floats]:
        table = flat.reshape(shape)
        value, slope = -0.5 * float(np.sum(table**2)), -table
        for one in reduced:
            own, own_slope = _evidence(table, one)
            value, slope = value + own, slope + own_slope
        return -value, -slope.ravel()

    scores = np.array([one.score for one in reduced])
    _, _, axes = np.linalg.svd(scores, full_matrices=True)
    start = axes[: shape[1]].T.ravel()
    found = minimize(descent, start, jac=True, method="L-BFGS-B", options={"maxiter": TURNS, "maxcor": 20})
    # Turned so that each stands at a right angle to the others where the pooled information is the measure.
    axes, sizes, _ = np.linalg.svd(found.x.reshape(shape), full_matrices=False)
    directions: Floats = basis @ (axes * sizes)
    return directions


def _evidence(loadings: Floats, log: LogLikelihood) -> tuple[float, Floats]:
    """Return the log marginal likelihood of one log and its gradient, (k, count)."""
    informed = log.information @ loadings
    inverse = np.linalg.inv(np.eye(loadings.shape[1]) + loadings.T @ informed)
    pull = loadings.T @ log.score
    mean = inverse @ pull
    value = 0.5 * float(pull @ mean) + 0.5 * float(np.linalg.slogdet(inverse)[1])
    return value, np.outer(log.score, mean) - informed @ (np.outer(mean, mean) + inverse)


def _seen(information: Floats) -> Floats:
    """Return a basis in which the pooled information is one, without what it hardly sees, (k, seen)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scale = np.where(np.diag(information) > 0.0, scale, 0.0)
    values, axes = np.linalg.eigh(information * scale[:, None] * scale)
    kept = values > SEEN * values[-1]
    basis: Floats = scale[:, None] * axes[:, kept] / np.sqrt(values[kept])
    return basis
