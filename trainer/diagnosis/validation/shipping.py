"""The model that is shipped: its parameters refitted, once it is known which causes it has.

What a diagnosis may tell is judged with parameters that move little, since those that move far take over what is
missing. A day ahead they predict better: a season changes more of a greenhouse than its walls.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.trainer.diagnosis.design.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import Knowledge
from igrow.trainer.diagnosis.search.actuators import Completed
from igrow.trainer.diagnosis.validation.correction import Corrected
from igrow.trainer.diagnosis.visible_parameters import members
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError


def shipped(
    completed: Completed, logged: LogDays, knowledge: Knowledge, result: Corrected
) -> tuple[Completed, Corrected]:
    """Return what a diagnosis has fitted, refitted as it is shipped.

    Args:
        completed: the log with actuators that it lacks, and the model recalibrated without them.
        logged: the log as it was logged.
        knowledge: of the model in force.
        result: of the correction.
    """
    prior, days, judged = knowledge.shipped_prior, completed.days, result.stages["corrected"]
    recalibrated = refitted(result.stages["recalibrated"], days, prior)
    if result.parameter is None:
        corrected = refitted(judged, days, prior)
    else:
        # Known which has changed, the others need not move far; but recalibration may have followed it better.
        here = np.array([name in members(result.parameter.parameter) for name in prior.names])
        freed = Refittable(judged, knowledge.prior.widened_along(knowledge.posterior.mean * here))
        corrected = judged if _is_no_worse(days, freed, Refittable(recalibrated, prior)) else recalibrated
    stages = {**result.stages, "recalibrated": recalibrated, "corrected": corrected}
    before = completed.recalibrated
    return (
        replace(completed, recalibrated=None if before is None else refitted(before, logged, prior)),
        replace(result, stages=stages),
    )


def _is_no_worse(days: LogDays, one: Refittable, other: Refittable) -> bool:
    """Tell whether a model predicts days that it was not fitted to no worse than another."""
    try:
        skill = cross_validated_skill(days, other, one)
    except DivergenceError:
        return False
    return skill is not None and skill >= 0.0


def refitted(stage: Stage, log: LogDays, prior: Gaussian) -> Stage:
    """Return a stage with its parameters refitted under another prior; as it was where its runs leave all bounds."""
    try:
        fitted = log.fit(prior, stage.terms, stage.posterior.values, stage.added or None)
    except DivergenceError:
        return stage
    return replace(stage, posterior=fitted)
