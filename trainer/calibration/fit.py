"""Calibration by Levenberg-Marquardt on batched free runs, under a prior, with a robust loss.

The residuals of free runs are correlated for hours; they are counted as what they are worth: each quantity's
variance and correlation time are estimated from the residuals and enter its weight, so that prior and data are
weighed fairly, and the posterior does not claim what a day of minutes cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow_core.errors import IgrowError
from igrow_core.simulator.hybrid import record as records
from igrow_core.simulator.hybrid.climate import ActiveEffects
from igrow_core.simulator.hybrid.measurement import PREDICTED
from igrow_core.simulator.hybrid.parameters import PARAMETERS
from igrow_core.simulator.hybrid.record import Record
from trainer.calibration.evaluation import starts_within
from trainer.calibration.posterior import Posterior

Floats = NDArray[np.float64]

_SPREADS = {"air_temperature": 0.5, "air_humidity": 3.0, "air_co2": 35.0}
"""Residual spread that weighs the quantities against each other while fitting, in the quantity's unit.

Fixed, since a quantity that is predicted badly would else lose its weight and be predicted worse still.
"""
_WORTH = 1.0 / 24.0
"""Independent residuals in each one kept, while fitting: a correlation time of 12 h.

What the model lacks lasts for hours, and the PLC answers it; with a higher worth the fit would take the vents'
answer to a missing heat flux for vents without effect (feedback bias)."""
_SAMPLE = 1800.0
"""Seconds between residuals that are kept of a run."""
_ROBUST = 2.0
"""Residuals beyond this many spreads lose weight (Huber)."""
_DIFFERENCE = 0.05
"""Finite difference of a parameter, in standard deviations of its prior."""


@dataclass(frozen=True)
class _Weights:
    """Per quantity: spread of the residuals, and how many independent ones a run holds."""

    spread: Mapping[str, float]
    worth: Mapping[str, float]


def calibrate(
    parts: Record | Sequence[tuple[Record, NDArray[np.bool_] | None]],
    knowledge: Posterior,
    effects: ActiveEffects,
    *,
    hours: float = 24.0,
    every_hours: float = 6.0,
    iterations: int = 12,
    start: Mapping[str, float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Posterior:
    """Return the parameters' posterior given logs.

    Args:
        parts: a record, or several with the rows that may be used (None: all); several compartments of one kind
            are fitted with one set of parameters.
        knowledge: the prior, whose names are the parameters that are fitted and the simulator's other inputs.
        effects: the active effects, held.
        hours: length of the free runs.
        every_hours: between their starts.
        iterations: at most.
        start: where the search starts, by name (None: the prior's mean).
        progress: is told of each iteration in a line.

    Raises:
        IgrowError: no complete run lies within the rows.
    """
    used = [(parts, None)] if isinstance(parts, Record) else list(parts)
    runs = []
    for record, rows in used:
        allowed = np.ones(len(record), dtype=bool) if rows is None else rows
        steps = max(1, round(hours * 3600.0 / record.step))
        starts = starts_within(record, allowed, steps, max(1, round(every_hours * 3600.0 / record.step)))
        if len(starts):
            first = max(0, int(starts[0]) - round(5 * 86_400.0 / record.step))
            last = int(starts[-1]) + steps + 1
            runs.append((record.slice(first, last), starts - first, steps))
    if not runs:
        raise IgrowError(f"no stretch of {hours:g} h of the log is complete enough to calibrate on")

    low = np.array([PARAMETERS[name].low for name in knowledge.names])
    high = np.array([PARAMETERS[name].high for name in knowledge.names])
    deviation = knowledge.standard_deviation
    precision = np.linalg.inv(knowledge.covariance)

    def residuals(points: Floats) -> dict[str, Floats]:
        """Residuals of m parameter points (m, p): by quantity, (m, samples per run, runs)."""
        return _residuals(runs, {name: points[:, k : k + 1] for k, name in enumerate(knowledge.names)}, effects)

    point = np.clip(knowledge.mean if start is None else np.array([start[n] for n in knowledge.names]), low, high)
    damping = 1e-2
    previous = residuals(point[None])
    weights = _Weights(_SPREADS, dict.fromkeys(_SPREADS, _WORTH))
    for iteration in range(iterations):
        cost = _cost(previous, weights) + _prior_cost(point, knowledge.mean, precision)
        step = _DIFFERENCE * deviation
        step = np.where(point + step > high, -step, step)
        shifted = residuals(point + np.diag(step))
        gradient, curvature = _normal_equations(previous, shifted, step, weights)
        gradient = gradient + precision @ (point - knowledge.mean)
        normal = curvature + precision
        improved = False
        candidate, trial = point, previous
        for _ in range(6):
            scaled = normal + damping * np.diag(np.diag(normal))
            candidate = _bounded_step(point, gradient, scaled, low, high)
            trial = residuals(candidate[None])
            after = _cost(trial, weights) + _prior_cost(candidate, knowledge.mean, precision)
            if after < cost:
                damping = max(damping * 0.2, 1e-6)
                improved = True
                break
            damping *= 6.0
        if not improved:
            break
        moved = float(np.max(np.abs(candidate - point) / deviation))
        point, previous = candidate, trial
        if progress is not None:
            spread = ", ".join(f"{name} {value:.3g}" for name, value in _estimate(previous).spread.items())
            progress(f"calibration step {iteration + 1}: residual spread {spread}")
        if moved < 0.01 or cost - after < 1e-4 * cost:
            break
    # What the data are worth is only known at the end, when the residuals are those of the fitted model.
    step = np.where(point + _DIFFERENCE * deviation > high, -_DIFFERENCE * deviation, _DIFFERENCE * deviation)
    _, curvature = _normal_equations(previous, residuals(point + np.diag(step)), step, _estimate(previous))
    return Posterior(knowledge.names, point, np.linalg.inv(curvature + precision))


def _residuals(
    runs: Sequence[tuple[Record, NDArray[np.int64], int]], parameters: Mapping[str, Floats], effects: ActiveEffects
) -> dict[str, Floats]:
    collected: dict[str, list[Floats]] = {name: [] for name in PREDICTED}
    for record, starts, steps in runs:
        states = records.observe(record, parameters, effects)
        shown = records.free_run(record, states, starts, steps, parameters, effects)
        every = max(1, round(_SAMPLE / record.step))
        kept = np.arange(every - 1, steps, every)
        for name, predicted in shown.items():
            measured = record.measured[name][starts + 1 + kept[:, None]]
            if name == "air_co2" and "co2_dosing" in record.unknown:
                continue  # Without the dose the CO2 would teach a greenhouse that is too tight.
            if np.isfinite(measured).any():
                collected[name].append(np.moveaxis(predicted[kept], 0, 1) - measured)
    return {name: np.concatenate(parts, axis=2) for name, parts in collected.items() if parts}


def _estimate(residuals: Mapping[str, Floats]) -> _Weights:
    """Estimate spreads (robust) and the number of independent residuals of a run (from their autocorrelation)."""
    spread, worth = {}, {}
    for name, values in residuals.items():
        errors = values[0]
        known = errors[np.isfinite(errors)]
        spread[name] = max(1.4826 * float(np.median(np.abs(known))), 0.2 * _SPREADS[name])
        clipped = np.clip(np.nan_to_num(errors), -3.0 * spread[name], 3.0 * spread[name])
        total = float(np.sum(clipped**2)) + 1e-12
        time = 1.0
        for lag in range(1, len(clipped)):
            correlation = float(np.sum(clipped[lag:] * clipped[:-lag])) / total * len(clipped) / (len(clipped) - lag)
            if correlation < 0.05:
                break
            time += 2.0 * correlation * (1.0 - lag / len(clipped))
        # Runs that overlap (several starts a day) tell the same thing again.
        worth[name] = 1.0 / time
    return _Weights(spread, worth)


def _scaled(name: str, values: Floats, weights: _Weights) -> tuple[Floats, Floats]:
    """Return residuals in spreads, and their robust weights times what each is worth."""
    ratio = np.where(np.isfinite(values), values, 0.0) / weights.spread[name]
    size = np.abs(ratio)
    robust = np.where(size > _ROBUST, _ROBUST / np.maximum(size, _ROBUST), 1.0)
    return ratio, robust * weights.worth[name]


def _cost(residuals: Mapping[str, Floats], weights: _Weights) -> float:
    total = 0.0
    for name, values in residuals.items():
        size = np.abs(np.nan_to_num(values[0])) / weights.spread[name]
        huber = np.where(size > _ROBUST, _ROBUST * (2.0 * size - _ROBUST), size**2)
        total += 0.5 * weights.worth[name] * float(huber.sum())
    return total


def _prior_cost(point: Floats, mean: Floats, precision: Floats) -> float:
    return 0.5 * float((point - mean) @ precision @ (point - mean))


def _normal_equations(
    base: Mapping[str, Floats], shifted: Mapping[str, Floats], step: Floats, weights: _Weights
) -> tuple[Floats, Floats]:
    count = len(step)
    gradient, curvature = np.zeros(count), np.zeros((count, count))
    for name, values in base.items():
        ratio, weight = _scaled(name, values[0], weights)
        difference = np.nan_to_num(shifted[name] - values[0]) / weights.spread[name]
        slope = difference.reshape(count, -1) / step[:, None]
        gradient += slope @ (ratio * weight).ravel()
        curvature += (slope * weight.ravel()) @ slope.T
    return gradient, curvature


def _bounded_step(point: Floats, gradient: Floats, normal: Floats, low: Floats, high: Floats) -> Floats:
    """Return the minimum of the quadratic model, parameters that would leave their bounds held there in turn."""
    free = np.ones(len(point), dtype=bool)
    candidate = point.copy()
    for _ in range(len(point)):
        move = np.zeros(len(point))
        held = candidate - point
        held[free] = 0.0
        right = -(gradient + normal @ held)
        move[free] = np.linalg.solve(normal[np.ix_(free, free)], right[free])
        proposed = np.where(free, point + move, candidate)
        outside = free & ((proposed < low) | (proposed > high))
        candidate = np.clip(proposed, low, high)
        if not outside.any():
            break
        free &= ~outside
    return candidate
