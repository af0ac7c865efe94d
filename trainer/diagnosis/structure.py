"""What the deployed model is known to miss already, from the log that it was calibrated on.

No simple model has the structure of its greenhouse. The misfit that stands in the calibration log is no finding:
it was there when the model was judged good. It is learned there as a ridge regression of the innovations on all
candidates and patterns together, goes with the bundle as one list of amplitudes, and enters a later diagnosis as
one column with a coefficient near one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.gram import solve
from igrow.trainer.diagnosis.prior import Prior
from igrow.trainer.diagnosis.problem import Problem, candidate_key, parameter_shift, pattern_key
from igrow.trainer.diagnosis.search import Model

RIDGE = 0.7
"""Prior deviation of each effect's amplitude, in typical amplitudes."""
PATTERN_RIDGE = 0.15
"""The same for a pattern, in its units."""
SPREAD = 0.3
"""How much of it may differ from one log to the next (relative deviation)."""
PARAMETER_PREFIX = "parameter:"
"""Key of a parameter's shift: what short errors say of it beside the long ones that it was calibrated on."""

Structure = Mapping[str, float]
"""Amplitude by key of a candidate or a pattern, shift by key of a parameter."""


def learn(problem: Problem) -> dict[str, float]:
    """Return the misfit of a calibrated model on its own log (all days)."""
    # The parameters stay where the recalibration put them: moved along, they would leave their bounds.
    columns = [*problem.candidate, *problem.pattern]
    scale = np.array(
        [RIDGE * EFFECTS[one.effect].amplitude.typical for one in problem.candidates]
        + [PATTERN_RIDGE] * len(problem.patterns)
    )
    solution = solve(problem.grams.of(columns, ()).sum(axis=0), np.diag(scale**-2.0))
    return dict(zip(keys(problem), map(float, solution.coefficients), strict=True)) | {
        PARAMETER_PREFIX + name: float(value)
        for name, value in zip(problem.prior.names, parameter_shift(problem), strict=True)
    }


def keys(problem: Problem) -> tuple[str, ...]:
    """Return the keys of all candidates and patterns of a log, in the order of their columns."""
    return (*map(candidate_key, problem.candidates), *map(pattern_key, problem.patterns))


def centre(knowledge: Prior, known: Structure) -> Prior:
    """Return the prior of a diagnosis: centred where the calibration log's own diagnosis put the parameters."""
    moved = {name: value + known.get(PARAMETER_PREFIX + name, 0.0) for name, value in knowledge.mean.items()}
    return Prior(knowledge.clip(moved), knowledge.standard_deviation)


def null_model(problem: Problem) -> Model:
    """Return the model under which nothing is missing: parameters, known and usual misfits, each under its prior."""
    deviations = np.array([*[SPREAD] * len(problem.known), *[1.0] * len(problem.usual)])
    size = len(problem.parameter)
    precision = np.zeros((size + len(deviations),) * 2)
    precision[:size, :size] = problem.prior.precision
    precision[size:, size:] = np.diag(deviations**-2.0)
    # The linearisation has none of the known misfit yet: it stands one below the prior's mean.
    shift = np.concatenate([parameter_shift(problem), [-1.0] * len(problem.known), np.zeros(len(problem.usual))])
    return Model((*problem.parameter, *problem.known, *problem.usual), precision, shift)
