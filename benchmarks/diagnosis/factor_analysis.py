"""The directions in which logs differ though nothing is missing: factor analysis of what each of them says.

What a log says of a list of amplitudes a is a normal likelihood, score @ a - a @ information @ a / 2. With
a = loadings @ z, and z standard normal and new in every log, z can be integrated out; the loadings are those that make
all logs together likeliest. This is factor analysis (Bishop 2006, Pattern Recognition and Machine Learning, sections
3.5 and 12.2) in which every log has its own, known noise. Scatter of regressions (principal components) would instead
hold what no log can tell apart, and did worse by far in greenhouses that nothing was learned from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis import compare, linear, search
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.nuisance import Direction

_SEEN = 1e-6
"""Share of the largest eigenvalue of the pooled information below which a direction is not looked at."""
_ITERATIONS = 150
"""Of the ascent at most."""


@dataclass(frozen=True)
class LogLikelihood:
    """What a log says of amplitudes, up to a constant."""

    keys: tuple[str, ...]
    """Of the amplitudes, (k,)."""
    information: Floats
    """(k, k), zero for an amplitude that the log cannot show."""
    score: Floats
    """(k,), its gradient where all amplitudes are zero."""


def marginal(design: Design) -> LogLikelihood:
    """Return what a log with nothing missing says of all effects and patterns, the null integrated out.

    Args:
        design: of the log, with the discrepancy of its model and without a nuisance subspace.
    """
    null = design.null_model()
    size = len(null.base)
    columns = [*null.base, *design.columns("effect"), *design.columns("pattern")]
    products = design.grams.of(columns, ()).sum(axis=0)
    information, score = products[1:, 1:], -products[0, 1:]
    information[:size, :size] += null.precision
    score[:size] += null.precision @ null.mean
    first, other = slice(0, size), slice(size, None)
    taken = np.linalg.solve(information[first, first], np.column_stack([information[first, other], score[first]]))
    return LogLikelihood(
        (*design.block("effect").labels, *design.block("pattern").labels),
        information[other, other] - information[other, first] @ taken[:, :-1],
        score[other] - information[other, first] @ taken[:, -1],
    )


def learn_directions(logs: Sequence[LogLikelihood], count: int) -> list[dict[str, float]]:
    """Return the directions of logs in which nothing is missing, each at its usual size, the largest first."""
    keys = sorted({key for one in logs for key in one.keys})
    return [
        {key: float(f"{value:.4g}") for key, value in zip(keys, axis, strict=True) if value != 0.0}
        for axis in loadings([_extended(one, keys) for one in logs], count).T
    ]


def evidence(found: Sequence[Direction], logs: Sequence[LogLikelihood]) -> float:
    """Return the log marginal likelihood of logs under directions over that of none (Bishop eq. 3.86)."""
    total = 0.0
    for log in logs:
        table = np.array([[one.get(key, 0.0) for one in found] for key in log.keys])
        total += _evidence(table, log.information, log.score)[0]
    return total


def null_amplitudes(design: Design) -> dict[str, float]:
    """Return the squared amplitude, less its variance, of every effect that a log shows alone, by effect.

    Args:
        design: of a log in which nothing is missing, with the nuisance subspace.
    """
    null = compare.profile(design, design.null_model())
    fit = linear.fit(design.grams, null.model)
    found = {}
    for one in search.score_candidates(design, fit, [None], np.random.default_rng(0)):
        if one.gain >= design.rules.least_fitted_gain:
            own = compare.profile(design, null.model.with_term(one.term), null.whitening)
            found[one.effect] = max(0.0, own.amplitudes[-1] ** 2 - own.deviations[-1] ** 2)
    return found


def root_mean_squares(logs: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the usual amplitude of every effect, from `null_amplitudes` of several logs."""
    names = sorted({name for one in logs for name in one})
    return {name: float(f"{np.sqrt(np.mean([one.get(name, 0.0) for one in logs])):.3g}") for name in names}


def loadings(logs: Sequence[LogLikelihood], count: int) -> Floats:
    """Return directions at their usual size, (k, count), the largest first; all logs have the same keys.

    A weak prior keeps each below about what a log can see: one unit where the pooled information is one.
    """
    basis = _visible(np.mean([one.information for one in logs], axis=0))
    reduced = [(basis.T @ one.information @ basis, basis.T @ one.score) for one in logs]
    shape = (basis.shape[1], min(count, basis.shape[1]))

    def descent(flat: Floats) -> tuple[float, Floats]:
        table = flat.reshape(shape)
        value, slope = -0.5 * float(np.sum(table**2)), -table
        for information, score in reduced:
            own, own_slope = _evidence(table, information, score)
            value, slope = value + own, slope + own_slope
        return -value, -slope.ravel()

    _, _, axes = np.linalg.svd(np.array([score for _, score in reduced]), full_matrices=True)
    start = axes[: shape[1]].T.ravel()
    found = minimize(descent, start, jac=True, method="L-BFGS-B", options={"maxiter": _ITERATIONS, "maxcor": 20})
    # Turned so that each stands at a right angle to the others where the pooled information is the measure.
    axes, sizes, _ = np.linalg.svd(found.x.reshape(shape), full_matrices=False)
    directions: Floats = basis @ (axes * sizes)
    return directions


def _extended(log: LogLikelihood, keys: Sequence[str]) -> LogLikelihood:
    """Return what a log says of a longer list of amplitudes, nothing of those that it cannot show."""
    place = {key: index for index, key in enumerate(keys)}
    places = [place[key] for key in log.keys]
    information, score = np.zeros((len(keys), len(keys))), np.zeros(len(keys))
    information[np.ix_(places, places)] = log.information
    score[places] = log.score
    return LogLikelihood(tuple(keys), information, score)


def _evidence(loadings: Floats, information: Floats, score: Floats) -> tuple[float, Floats]:
    """Return the log marginal likelihood of one log and its gradient, (k, count)."""
    informed = information @ loadings
    inverse = np.linalg.inv(np.eye(loadings.shape[1]) + loadings.T @ informed)
    pull = loadings.T @ score
    mean = inverse @ pull
    value = 0.5 * float(pull @ mean) + 0.5 * float(np.linalg.slogdet(inverse)[1])
    return value, np.outer(score, mean) - informed @ (np.outer(mean, mean) + inverse)


def _visible(information: Floats) -> Floats:
    """Return a basis in which the pooled information is one, without what it hardly sees, (k, seen)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scale = np.where(np.diag(information) > 0.0, scale, 0.0)
    values, axes = np.linalg.eigh(information * scale[:, None] * scale)
    kept = values > _SEEN * values[-1]
    basis: Floats = scale[:, None] * axes[:, kept] / np.sqrt(values[kept])
    return basis
