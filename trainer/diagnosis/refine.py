"""The found terms refitted where they are: sizes, shapes and parameters together, the noise without the effect in it.

The search linearises at a model without the effect, with the weights that its large innovations got there; a strong
effect then looks smaller than it is. Here the effect is active: a few Gauss-Newton steps on amplitudes, shapes and
parameters under their priors, with colour and weights fitted anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis import linearisation
from igrow.trainer.diagnosis.activation import ActiveTerm, activate
from igrow.trainer.diagnosis.linearisation import Floats, Linearisation
from igrow.trainer.diagnosis.problem import Problem, averaged, counted_intervals, recalibrate
from igrow.trainer.diagnosis.search import Fit
from igrow.trainer.diagnosis.structure import SPREAD

STEPS = 6
SHAPE_SPREAD = 0.12
"""Prior deviation of a shape about the value that the search found, as a share of its range."""


@dataclass(frozen=True)
class Refined:
    """A term at its refitted values."""

    term: ActiveTerm
    deviation: float
    """Of the amplitude, the larger of the curvature's and of the scatter of day scores."""
    shape_deviation: dict[str, float]
    regimes: dict[str, tuple[float, float]]
    """(amplitude, standard deviation) by regime, all else held."""


def refine(problem: Problem, fit: Fit, terms: Sequence[ActiveTerm], before: Sequence[ActiveTerm]) -> list[Refined]:
    """Refit terms together.

    Args:
        problem: that they were found in.
        fit: of the search, with these terms; its parameters are where the steps start.
        terms: found, in any order.
        before: terms of the deployed model, held.
    """
    prior = problem.prior
    count = len(problem.parameter)
    change = fit.solution.coefficients[:count]
    start = {name: problem.line.parameters[name] + float(step) for name, step in zip(prior.names, change, strict=True)}
    parameters = prior.clip(start)
    current = list(terms)
    misfit = problem.expected[: len(problem.known)].sum(axis=0)
    interval = problem.interval
    deviation = np.zeros(0)
    regimes: list[dict[str, tuple[float, float]]] = []
    for step in range(STEPS):
        line = _line(problem, parameters, [*before, *current])
        # The noise is fitted about the model as it now stands; its parameters do not move here.
        _, whitening, balances = recalibrate(line, problem.split, prior, misfit, interval, rounds=0)
        knobs = [(index, None) for index in range(len(current))] + [
            (index, shape.name) for index, term in enumerate(current) for shape in EFFECTS[term.effect].shapes
        ]
        slopes = [_slope(problem, line, before, current, index, shape) for index, shape in knobs]
        columns = [
            line.errors[None],
            linearisation.parameter_columns(line, prior.names, prior.spread),
            problem.expected,
            np.stack(slopes),
        ]
        counted = counted_intervals(line, balances, interval) & problem.split.fit[line.runs.day][:, None]
        length = line.record.step
        stack = np.concatenate(
            [whitening(averaged(part[:, list(balances)], length, interval) * counted) for part in columns]
        )
        daily = stack.transpose(2, 0, 1, 3).reshape(len(line.runs.day), len(stack), -1)
        products = np.matmul(daily, daily.transpose(0, 2, 1))
        total = products.sum(axis=0)
        known, usual = len(problem.known), len(problem.usual)
        spread = np.array([_spread(current[index], shape) for index, shape in knobs])
        precision = np.concatenate([prior.spread**-2.0, np.full(known, SPREAD**-2.0), np.ones(usual), spread**-2.0])
        shift = np.concatenate(
            [
                [parameters[name] - prior.mean[name] for name in prior.names],
                -np.ones(known),
                np.zeros(usual),
                [_away(current[index], terms[index], shape) for index, shape in knobs],
            ]
        )
        inverse = np.linalg.inv(total[1:, 1:] + np.diag(precision))
        moved = inverse @ (-total[1:, 0] - precision * shift)
        scores = products[:, 1:, :] @ np.concatenate([[1.0], moved])
        influence = scores @ inverse
        scatter = np.sqrt(np.sum((influence - influence.mean(axis=0)) ** 2, axis=0))
        deviation = np.maximum(np.sqrt(np.diag(inverse)), scatter)[-len(knobs) :]
        parameters = prior.clip(
            {name: parameters[name] + float(part) for name, part in zip(prior.names, moved[:count], strict=True)}
        )
        limit = np.array([_longest(current[index], shape) for index, shape in knobs])
        steps = np.clip(moved[-len(knobs) :], -limit, limit)
        current = [
            _moved(term, {shape: float(part) for (at, shape), part in zip(knobs, steps, strict=True) if at == index})
            for index, term in enumerate(current)
        ]
        residual = np.tensordot(np.concatenate([[1.0], moved]), stack, axes=1)
        offset = len(stack) - len(knobs)
        regimes = [
            _regimes(line, interval, residual, stack[offset + index], current[index].amplitude)
            for index in range(len(current))
        ]
        if step and np.all(np.abs(steps) < 0.1 * deviation):
            break
    return [
        Refined(
            term,
            float(deviation[index]),
            {
                shape: float(part)
                for (at, shape), part in zip(knobs, deviation, strict=True)
                if at == index and shape is not None
            },
            regimes[index],
        )
        for index, term in enumerate(current)
    ]


def told_apart(terms: Sequence[Refined]) -> bool:
    """Tell whether terms that were fitted together each have a size of their own."""
    return all(abs(one.term.amplitude) > one.deviation for one in terms)


def _line(problem: Problem, parameters: dict[str, float], terms: Sequence[ActiveTerm]) -> Linearisation:
    record = problem.line.record
    return linearisation.linearise(record, problem.line.runs, parameters, activate(record, terms))


def _slope(
    problem: Problem,
    line: Linearisation,
    before: Sequence[ActiveTerm],
    terms: Sequence[ActiveTerm],
    index: int,
    shape: str | None,
) -> Floats:
    """Return d(error)/d(amplitude or shape) of one term, (3, r, steps)."""
    term = terms[index]
    small = 0.05 * _scale(term, shape)
    tried = [_moved(term, {shape: step}) for step in (small, -small)]
    # At a bound one of both steps is held back.
    other = max(tried, key=lambda one: abs(_value(one, shape) - _value(term, shape)))
    moved = _line(problem, dict(line.parameters), [*before, *terms[:index], other, *terms[index + 1 :]])
    slope: Floats = (moved.errors - line.errors) / (_value(other, shape) - _value(term, shape))
    return slope


def _moved(term: ActiveTerm, steps: dict[str | None, float]) -> ActiveTerm:
    """Return a term with its amplitude (None) and shapes moved, within their bounds."""
    definition = EFFECTS[term.effect]
    amplitude = definition.amplitude
    value = min(max(term.amplitude + steps.get(None, 0.0), amplitude.low), amplitude.high)
    shape = {
        one.name: min(max(term.shape[one.name] + steps.get(one.name, 0.0), one.low), one.high)
        for one in definition.shapes
    }
    return replace(term, amplitude=value, shape=shape)


def _value(term: ActiveTerm, shape: str | None) -> float:
    return term.amplitude if shape is None else term.shape[shape]


def _scale(term: ActiveTerm, shape: str | None) -> float:
    definition = EFFECTS[term.effect]
    if shape is None:
        return max(abs(term.amplitude), 0.2 * abs(definition.amplitude.typical))
    one = next(one for one in definition.shapes if one.name == shape)
    return SHAPE_SPREAD * (one.high - one.low) * (1.0 if term.shape[shape] < 0.5 * (one.low + one.high) else -1.0)


def _longest(term: ActiveTerm, shape: str | None) -> float:
    """Return the longest step of a knob: half of its size, lest an undamped step runs away."""
    return 0.5 * abs(_scale(term, shape)) if shape is None else abs(_scale(term, shape))


def _regimes(
    line: Linearisation, interval: float, residual: Floats, slope: Floats, amplitude: float
) -> dict[str, tuple[float, float]]:
    """Return (amplitude, standard deviation) refitted on the rows of each regime, all else held.

    Args:
        line: of the refitted model.
        interval: seconds over which errors are averaged.
        residual: whitened, after the fit, (b, r, intervals).
        slope: whitened, of the amplitude, (b, r, intervals).
        amplitude: as fitted on all rows.
    """
    rows = line.runs.rows - 1
    inputs = line.record.inputs
    wind, vents = inputs["wind_speed"][rows], (inputs["vent_lee"] + inputs["vent_wind"])[rows]
    light, middle = inputs["global_radiation"][rows], np.median(line.runs.starts)
    early = np.broadcast_to((line.runs.starts <= middle)[:, None], rows.shape)
    masks = {
        "day": light > 20.0,
        "night": light <= 20.0,
        "calm": wind <= np.median(wind),
        "windy": wind > np.median(wind),
        "vents shut": vents < 2.0,
        "vents open": vents >= 2.0,
        "first half": early,
        "second half": ~early,
    }
    whole = float(np.sum(slope**2))
    found = {}
    for name, mask in masks.items():
        inside = averaged(mask.astype(np.float64), line.record.step, interval) > 0.5
        curvature = float(np.sum((slope * inside) ** 2))
        # A regime in which the effect hardly shows tells nothing of it.
        if curvature > 0.02 * whole:
            change = -float(np.sum(slope * residual * inside)) / curvature
            found[name] = (amplitude + change, curvature**-0.5)
    return found


def _spread(term: ActiveTerm, shape: str | None) -> float:
    """Return the prior deviation of a knob; amplitudes are free."""
    if shape is None:
        return 1e6 * max(abs(EFFECTS[term.effect].amplitude.typical), 1e-6)
    return abs(_scale(term, shape))


def _away(term: ActiveTerm, found: ActiveTerm, shape: str | None) -> float:
    return 0.0 if shape is None else term.shape[shape] - found.shape[shape]
