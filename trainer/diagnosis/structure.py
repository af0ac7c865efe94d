"""What the deployed model is known to miss already, from the log that it was calibrated on.

No simple model has the structure of its greenhouse. The misfit that stands in the calibration log is no finding:
it was there when the model was judged good. It is learned there as a ridge regression of the innovations on all
candidates and patterns together, goes with the bundle as one list of amplitudes, and enters a later diagnosis as
one column with a coefficient near one, beside a little slack on each candidate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow_core.effects import EFFECTS
from trainer.diagnosis.gram import solve
from trainer.diagnosis.prior import Prior
from trainer.diagnosis.problem import Problem, candidate_key, parameter_shift, pattern_key
from trainer.diagnosis.search import Model

RIDGE = 2.0
"""Prior deviation of each effect's amplitude, in typical amplitudes."""
PATTERN_RIDGE = 0.5
"""The same for a pattern, in its units."""
SPREAD = 0.3
"""How much of it may differ from one log to the next (relative deviation)."""
SLACK = 1e-6
"""Deviation of what any candidate may have in a log for which nothing is missing, in typical amplitudes."""

PARAMETER_PREFIX = "parameter:"
"""Key of a parameter's shift: what short errors say of it beside the long ones that it was calibrated on."""

Structure = Mapping[str, float]
"""Amplitude by key of a candidate or a pattern, shift by key of a parameter."""


def learn(problem: Problem) -> dict[str, float]:
    """Return the misfit of a calibrated model on its own log (all days)."""
    columns = [*problem.candidate, *problem.pattern]
    keys = [candidate_key(one) for one in problem.candidates] + [pattern_key(one) for one in problem.patterns]
    scale = np.array(
        [RIDGE * EFFECTS[one.effect].amplitude.typical for one in problem.candidates]
        + [PATTERN_RIDGE] * len(problem.patterns)
    )
    # The parameters stay where the recalibration put them: moved along, they would leave their bounds.
    products = problem.grams.of(columns, ()).sum(axis=0)
    solution = solve(products, np.diag(scale**-2.0))
    misfit = {key: float(value) for key, value in zip(keys, solution.coefficients, strict=True)}
    return misfit | {
        PARAMETER_PREFIX + name: float(value)
        for name, value in zip(problem.prior.names, parameter_shift(problem), strict=True)
    }


def centre(knowledge: Prior, known: Structure) -> Prior:
    """Return the prior of a diagnosis: centred where the calibration log's own diagnosis put the parameters."""
    moved = {name: value + known.get(PARAMETER_PREFIX + name, 0.0) for name, value in knowledge.mean.items()}
    return Prior(knowledge.clip(moved), knowledge.standard_deviation)


def null_model(problem: Problem) -> Model:
    """Return the model under which nothing is missing: parameters, known misfit and slack, each under its prior."""
    typical = [
        index
        for index, candidate in zip(problem.candidate, problem.candidates, strict=True)
        if candidate.shape == nearest_shape(problem, candidate.effect)
    ]
    slack = [
        SLACK * abs(EFFECTS[problem.candidates[index - problem.candidate.start].effect].amplitude.typical)
        for index in typical
    ]
    deviations = np.array([*[SPREAD] * len(problem.known), *slack])
    size = len(problem.parameter)
    precision = np.zeros((size + len(deviations),) * 2)
    precision[:size, :size] = problem.prior.precision
    precision[size:, size:] = np.diag(deviations**-2.0)
    # The linearisation has none of the known misfit yet: it stands one below the prior's mean.
    shift = np.concatenate([parameter_shift(problem), [-1.0] * len(problem.known), np.zeros(len(slack))])
    return Model((*problem.parameter, *problem.known, *typical), precision, shift)


def nearest_shape(problem: Problem, effect: str) -> tuple[tuple[str, float], ...]:
    """Return the shape of a candidate that lies nearest to the typical one."""
    shapes = [candidate.shape for candidate in problem.candidates if candidate.effect == effect]
    definition = {shape.name: shape for shape in EFFECTS[effect].shapes}

    def distance(shape: tuple[tuple[str, float], ...]) -> float:
        return sum(
            abs(value - definition[name].typical) / (definition[name].high - definition[name].low)
            for name, value in shape
        )

    return min(shapes, key=distance)
