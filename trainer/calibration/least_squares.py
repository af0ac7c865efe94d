"""Levenberg-Marquardt for models that run many parameter points in one batch: robust, with prior and bounds.

The residuals of runs over hours are correlated; they are counted as what they are worth: `Scale` says how large a
residual is that counts as one, and how many independent ones there are in each one kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Mapping[str, Floats]]
"""Points (m, p) -> residuals by kind, (m, ...) each, NaN where nothing was measured."""

_ROBUST = 2.0
"""Residuals beyond this many spreads lose weight (Huber)."""
_DIFFERENCE = 0.05
"""Finite difference of a parameter, in standard deviations of its prior."""


@dataclass(frozen=True)
class Scale:
    """How a kind of residuals counts."""

    spread: float
    """In the quantity's unit."""
    worth: float
    """Independent residuals in each one kept, 0 to 1."""


@dataclass(frozen=True)
class Problem:
    """What is minimised: half the sum of squared residuals in spreads (Huber), and of the distance to the prior."""

    residuals: Residuals
    scales: Mapping[str, Scale]
    mean: Floats
    """Of the prior, (p,)."""
    covariance: Floats
    """Of the prior, (p, p)."""
    low: Floats
    high: Floats


def minimise(
    problem: Problem, start: Floats, iterations: int, progress: Callable[[int, Mapping[str, Floats]], None]
) -> tuple[Floats, Mapping[str, Floats]]:
    """Return the best point (p,) and its residuals, (1, ...) each.

    Args:
        problem: what is minimised.
        start: where the search starts, (p,).
        iterations: at most.
        progress: is called after each with its number and residuals.
    """
    deviation = np.sqrt(np.diag(problem.covariance))
    precision: Floats = np.linalg.inv(problem.covariance).astype(np.float64)
    point = np.clip(start, problem.low, problem.high)
    previous = problem.residuals(point[None])
    damping = 1e-2
    for iteration in range(iterations):
        cost = _cost(problem, previous, point, precision)
        gradient, curvature = _normal_equations(problem, previous, point, problem.scales)
        gradient = gradient + precision @ (point - problem.mean)
        normal = curvature + precision
        for _ in range(6):
            candidate = _bounded_step(
                point, gradient, normal + damping * np.diag(np.diag(normal)), problem.low, problem.high
            )
            trial = problem.residuals(candidate[None])
            after = _cost(problem, trial, candidate, precision)
            if after < cost:
                break
            damping *= 6.0
        else:
            break
        damping = max(damping * 0.2, 1e-6)
        moved = float(np.max(np.abs(candidate - point) / deviation))
        point, previous = candidate, trial
        progress(iteration + 1, previous)
        if moved < 0.01 or cost - after < 1e-4 * cost:
            break
    return point, previous


def covariance(problem: Problem, point: Floats, residuals: Mapping[str, Floats], scales: Mapping[str, Scale]) -> Floats:
    """Return the covariance of the posterior at a point, (p, p), residuals counted by `scales`."""
    _, curvature = _normal_equations(problem, residuals, point, scales)
    return np.asarray(np.linalg.inv(curvature + np.linalg.inv(problem.covariance)))


def observed_scale(errors: Floats, least: float) -> Scale:
    """Return the scale that residuals over time (k, runs) show: a robust spread and the worth by autocorrelation."""
    known = errors[np.isfinite(errors)]
    spread = max(1.4826 * float(np.median(np.abs(known))), least)
    clipped = np.clip(np.nan_to_num(errors), -3.0 * spread, 3.0 * spread)
    total = float(np.sum(clipped**2)) + 1e-12
    time = 1.0
    for lag in range(1, len(clipped)):
        correlation = float(np.sum(clipped[lag:] * clipped[:-lag])) / total * len(clipped) / (len(clipped) - lag)
        if correlation < 0.05:
            break
        time += 2.0 * correlation * (1.0 - lag / len(clipped))
    return Scale(spread, 1.0 / time)


def _cost(problem: Problem, residuals: Mapping[str, Floats], point: Floats, precision: Floats) -> float:
    away = point - problem.mean
    total = 0.5 * float(away @ precision @ away)
    for name, values in residuals.items():
        scale = problem.scales[name]
        size = np.abs(np.nan_to_num(values[0])) / scale.spread
        huber = np.where(size > _ROBUST, _ROBUST * (2.0 * size - _ROBUST), size**2)
        total += 0.5 * scale.worth * float(huber.sum())
    return total


def _normal_equations(
    problem: Problem, base: Mapping[str, Floats], point: Floats, scales: Mapping[str, Scale]
) -> tuple[Floats, Floats]:
    step = _DIFFERENCE * np.sqrt(np.diag(problem.covariance))
    step = np.where(point + step > problem.high, -step, step)
    shifted = problem.residuals(point + np.diag(step))
    count = len(step)
    gradient, curvature = np.zeros(count), np.zeros((count, count))
    for name, values in base.items():
        scale = scales[name]
        ratio = np.where(np.isfinite(values[0]), values[0], 0.0) / scale.spread
        size = np.abs(ratio)
        weight = scale.worth * np.where(size > _ROBUST, _ROBUST / np.maximum(size, _ROBUST), 1.0)
        slope = (np.nan_to_num(shifted[name] - values[0]) / scale.spread).reshape(count, -1) / step[:, None]
        gradient += slope @ (ratio * weight).ravel()
        curvature += (slope * weight.ravel()) @ slope.T
    return gradient, curvature


def _bounded_step(point: Floats, gradient: Floats, normal: Floats, low: Floats, high: Floats) -> Floats:
    """Return the minimum of the quadratic model, parameters that would leave their bounds held there in turn."""
    free = np.ones(len(point), dtype=bool)
    candidate = point.copy()
    for _ in range(len(point)):
        held = np.where(free, 0.0, candidate - point)
        right = -(gradient + normal @ held)
        move = np.zeros(len(point))
        move[free] = np.linalg.solve(normal[np.ix_(free, free)], right[free])
        proposed = np.where(free, point + move, candidate)
        outside = free & ((proposed < low) | (proposed > high))
        candidate = np.clip(proposed, low, high)
        if not outside.any():
            break
        free &= ~outside
    return candidate
