"""Every fit of a simulated model: weighted, robust least squares under a normal prior, within bounds.

    minimise  1/2 sum_i w_i rho(r_i(x)) + 1/2 (x - m)^T S^-1 (x - m),   low <= x <= high

by `scipy.optimize.least_squares`, the prior as p further rows. `rho` is Huber's loss, or the square. What a fit gives
is a normal distribution about the minimum (Laplace's approximation), with the curvature of iteratively reweighted
least squares: an error in the linear part of the loss tells less, but not nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from igrow.core.arrays import Floats, Mask
from igrow.core.errors import IgrowError
from igrow.trainer.fit.gaussian import Gaussian

Residuals = Callable[[Floats], Floats]
"""Point (p,) -> errors in units of their scale, (n,)."""
Jacobian = Callable[[Floats], Floats]
"""Point (p,) -> d(errors)/d(point), (n, p)."""
Batch = Callable[[Floats], Floats]
"""Points (m, p) -> errors in units of their scale, (m, n)."""

Answer = TypeVar("Answer")

DIFFERENCE = 0.05
"""Finite difference of a parameter, in standard deviations of its prior."""
_COST_TOLERANCE = 1e-5
"""Relative fall of the cost at which a search ends."""
_STEP_TOLERANCE = 1e-3
"""Length of a step, relative to the way from the start in the prior's standard deviations, at which it ends."""
_AT_BOUND = 1e-3
"""Distance from a bound, in standard deviations of the prior, within which a solution lies on it."""
_INSIDE = 0.1
"""Distance from a bound, in standard deviations of the prior, at which a search begins that may not begin on it."""
RUNAWAY = 1e6
"""Change of an error, in its scale or its unit, for a standard deviation of a parameter, from which on the model runs
out of all bounds a little further on, whether or not the run still ends in a number."""
_ARRIVED = 1e-3
"""Relative fall of the cost that a full step without bounds promises at most where a search has arrived."""


class DivergenceError(IgrowError):
    """The model runs out of all bounds."""


@dataclass(frozen=True)
class Solution:
    """The minimum of a fit, and what is known about it."""

    posterior: Gaussian
    """The fitted parameters, and their covariance by the weights of the fit."""
    residuals: Floats
    """At the minimum, (n,)."""
    jacobian: Floats
    """At the minimum, (n, p)."""
    cost: float
    """What was minimised, at the minimum."""


def solve(
    residuals: Residuals,
    jacobian: Jacobian,
    prior: Gaussian,
    low: Floats,
    high: Floats,
    *,
    weights: Floats | float = 1.0,
    robust: float = np.inf,
    start: Floats | None = None,
    evaluations: int = 60,
    progress: Callable[[int, Floats], None] | None = None,
) -> Solution:
    """Return the minimum.

    Args:
        residuals: of the model; may raise DivergenceError, and the search then takes a shorter step.
        jacobian: of the model.
        prior: of the parameters.
        low: least value of each parameter, (p,).
        high: largest value, (p,).
        weights: independent errors that each one counts for, (n,); 0 leaves it out, and it may then be NaN.
        robust: size of an error from which on it counts linearly.
        start: where the search begins, (p,); None: at the prior's mean.
        evaluations: points that each method may try.
        progress: is told the number of each step, and the errors there, (n,).

    Raises:
        DivergenceError: the model has no finite error where the search begins.
    """
    begin = np.clip(prior.mean if start is None else start, low, high)
    scale = prior.standard_deviation
    whitening = prior.whitening
    count = len(residuals(begin))
    weight = np.broadcast_to(np.asarray(weights, dtype=np.float64), count)
    limit = np.append(robust * np.sqrt(np.maximum(weight, 1e-300)), np.full(len(begin), np.inf))
    latest: tuple[Floats, Floats, Floats] = (begin, np.zeros(0), np.zeros(0))
    steps = 0

    def rows(moved: Floats) -> Floats:
        point = begin + scale * moved
        try:
            return np.append(_counted(residuals(point), weight), whitening @ (point - prior.mean))
        except DivergenceError:
            return np.full(len(limit), np.inf)

    def slopes(moved: Floats) -> Floats:
        nonlocal latest, steps
        point = begin + scale * moved
        latest = point, residuals(point), _finite_slopes(jacobian(point), weight, scale)
        if progress is not None:
            progress(steps, latest[1])
        steps += 1
        return np.concatenate([_counted(latest[2].T, weight).T, whitening]) * scale

    if not np.isfinite(rows(np.zeros(len(begin)))).all():
        raise DivergenceError("the model runs out of all bounds where the fit begins")
    place = np.zeros(len(begin))
    edges = (low - begin) / scale, (high - begin) / scale
    # "dogbox" is quick, exact, and lies on bounds, but it can stop on its way where several parameters lie near theirs;
    # "trf" goes on from there, if it does not begin on a bound.
    for method in ("dogbox", "trf"):
        # Errors near the largest number are of points that are never taken; whoever fits has done nothing wrong.
        with np.errstate(over="ignore", invalid="ignore"):
            found = least_squares(
                rows,
                place,
                jac=slopes,
                bounds=edges,
                method=method,
                loss=lambda squares: _huber(squares, limit),
                ftol=_COST_TOLERANCE,
                xtol=_STEP_TOLERANCE,
                max_nfev=evaluations,
            )
        if _has_arrived(found):
            break
        inside = np.minimum(_INSIDE, 0.5 * (edges[1] - edges[0]))
        place = np.clip(found.x, edges[0] + inside, edges[1] - inside)
    point, errors, slope = latest
    near = _AT_BOUND * scale
    point = np.where(point < low + near, low, np.where(point > high - near, high, point))
    posterior = Gaussian(prior.names, point, covariance(errors, slope, prior, weights=weight, robust=robust))
    return Solution(posterior, errors, slope, float(found.cost))


def step(
    residuals: Floats,
    jacobian: Floats,
    prior: Gaussian,
    low: Floats,
    high: Floats,
    start: Floats,
    *,
    weights: Floats | float = 1.0,
    robust: float = np.inf,
) -> Floats:
    """Return where one Gauss-Newton step within the bounds leads, (p,); other arguments as `solve`'s.

    Args:
        residuals: where it begins, (n,).
        jacobian: there, (n, p).
        prior: of the parameters.
        low: least values, (p,).
        high: largest values, (p,).
        start: where it begins, (p,); within the bounds.
        weights: independent errors that each one counts for.
        robust: size of an error from which on it counts linearly.
    """
    weight = np.broadcast_to(np.asarray(weights, dtype=np.float64), len(residuals))
    slope, errors, scale = _weighted(
        residuals, _finite_slopes(jacobian, weight, prior.standard_deviation), prior, weight, robust
    )
    white = prior.whitening
    slopes, apart = np.concatenate([slope, white * scale]), np.append(errors, white @ (start - prior.mean))
    # A triangle in place of many rows: the same sum of squares.
    orthogonal, triangle = np.linalg.qr(slopes)
    edges = (low - start) / scale, (high - start) / scale
    found = lsq_linear(triangle, -(orthogonal.T @ apart), bounds=edges)
    return np.asarray(np.clip(start + scale * found.x, low, high))


def covariance(
    residuals: Floats, jacobian: Floats, prior: Gaussian, *, weights: Floats | float = 1.0, robust: float = np.inf
) -> Floats:
    """Return the covariance of the posterior about a point, (p, p); arguments as `solve`'s, at that point."""
    slope, _, scale = _weighted(residuals, jacobian, prior, weights, robust)
    white = prior.whitening * scale
    inverse: Floats = np.linalg.inv(slope.T @ slope + white.T @ white) * np.outer(scale, scale)
    return 0.5 * (inverse + inverse.T)


def remembered(model: Callable[[Floats], Answer]) -> Callable[[Floats], Answer]:
    """Return a model that knows its answer to the latest point: it is asked for slopes too, and where a fit goes on.

    Args:
        model: of a point (p,); nobody may write into its answer.
    """

    @lru_cache(maxsize=1)
    def known(point: bytes) -> Answer:
        return model(np.frombuffer(point))

    return lambda point: known(point.tobytes())


def by_differences(batch: Batch, prior: Gaussian, high: Floats) -> tuple[Residuals, Jacobian]:
    """Return residuals and Jacobian of a model that runs many points in one batch.

    Args:
        batch: the model.
        prior: of the parameters; a difference is `DIFFERENCE` of its standard deviation.
        high: largest value of each parameter, (p,); a difference that would pass it goes the other way.
    """

    residuals: Residuals = remembered(lambda point: np.asarray(batch(point[None])[0]))

    def jacobian(point: Floats) -> Floats:
        step = DIFFERENCE * prior.standard_deviation
        step = np.where(point + step > high, -step, step)
        return np.asarray((batch(point + np.diag(step)) - residuals(point)).T / step)

    return residuals, jacobian


def _has_arrived(found: OptimizeResult) -> bool:
    """Tell whether a full Gauss-Newton step of the parameters that lie on no bound promises next to nothing."""
    free = found.active_mask == 0
    slope, gradient = found.jac[:, free], found.grad[free]
    fall = 0.5 * float(gradient @ np.linalg.lstsq(slope.T @ slope, gradient, rcond=None)[0])
    return fall <= _ARRIVED * float(found.cost)


def is_bounded(slopes: Floats, scale: Floats | float) -> Mask:
    """Tell of each slope whether the model stays within all bounds a little further on, as `RUNAWAY` says.

    Args:
        slopes: change of errors with a parameter, of any shape.
        scale: standard deviation of the parameter, or a typical size of it, that broadcasts to that shape.
    """
    # No comparison holds of what is no number.
    bounded: Mask = np.abs(slopes) < RUNAWAY / np.asarray(scale)
    return bounded


def _finite_slopes(jacobian: Floats, weight: Floats, scale: Floats) -> Floats:
    """Return slopes (n, p), 0 of what runs out of all bounds a little further on: it stays where it is in a step.

    Args:
        jacobian: slopes, (n, p).
        weight: of the errors, (n,); a slope of one that does not count may be anything.
        scale: standard deviations of the prior, (p,).
    """
    return np.where(is_bounded(jacobian[weight > 0.0], scale).all(axis=0), jacobian, 0.0)


def _weighted(
    residuals: Floats, jacobian: Floats, prior: Gaussian, weights: Floats | float, robust: float
) -> tuple[Floats, Floats, Floats]:
    """Return slopes in standard deviations of the prior, (n, p), and errors, (n,), as they count; and these, (p,)."""
    weight = np.broadcast_to(np.asarray(weights, dtype=np.float64), len(residuals))
    size = np.abs(_counted(residuals, (weight > 0.0).astype(np.float64)))
    kept = weight * np.where(size > robust, robust / np.maximum(size, 1e-12), 1.0)
    scale = prior.standard_deviation
    return _counted(jacobian.T, kept).T * scale, _counted(residuals, kept), scale


def _counted(values: Floats, weight: Floats) -> Floats:
    """Return values (..., n) times the roots of their weights, 0 where they do not count."""
    return np.asarray(np.where(weight > 0.0, values, 0.0) * np.sqrt(weight))


def _huber(squares: Floats, limit: Floats) -> Floats:
    """Return Huber's loss of squared errors, its slope, and 0 for the curvature of its weights, (3, n)."""
    size = np.maximum(np.sqrt(squares), 1e-300)
    far = size > limit
    edge = np.where(far, limit, 0.0)
    loss = np.where(far, edge * (2.0 * size - edge), squares)
    return np.stack([loss, np.where(far, edge / size, 1.0), np.zeros_like(size)])
