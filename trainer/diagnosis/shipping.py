"""The model that is shipped: its parameters refitted, once it is known which causes it has.

What a diagnosis may tell is judged with parameters that move little, since those that move far take over what is
missing. A day ahead they predict better: a season changes more of a greenhouse than its walls.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from igrow.trainer.diagnosis.actuators import Completed
from igrow.trainer.diagnosis.correction import Corrected
from igrow.trainer.diagnosis.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import Knowledge
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.visible_parameters import members
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError


def shipped(
    completed: Completed, logged: LogDays, knowledge: Knowledge, result: Corrected, rules: DecisionRules
) -> tuple[Completed, Corrected]:
    """Return what a diagnosis has fitted, refitted as it is shipped.

    Args:
        completed: the log with actuators that it lacks, and the model recalibrated without them.
        logged: the log as it was logged.
        knowledge: of the model in force.
        result: of the correction.
        rules: what a parameter that has changed must add to be free.
    """
    prior, days = knowledge.shipped_prior, completed.days
    recalibrated = refitted(result.stages["recalibrated"], days, prior)
    corrected = refitted(result.stages["corrected"], days, prior)
    if result.parameter is not None:
        here = np.array([name in members(result.parameter.parameter) for name in prior.names])
        freed = prior.widened_along(knowledge.posterior.mean * here)
        changed = refitted(result.stages["corrected"], days, freed)
        # Recalibration may have followed the change.
        adds = _skill(days, Refittable(recalibrated, prior), Refittable(changed, freed)) >= rules.least_skill
        corrected = changed if adds else recalibrated
    stages = {**result.stages, "recalibrated": recalibrated, "corrected": corrected}
    before = completed.recalibrated
    return (
        replace(completed, recalibrated=None if before is None else refitted(before, logged, prior)),
        replace(result, stages=stages),
    )


def _skill(days: LogDays, before: Refittable, after: Refittable) -> float:
    try:
        skill = cross_validated_skill(days, before, after)
    except DivergenceError:
        return 0.0
    return skill or 0.0


def refitted(stage: Stage, log: LogDays, prior: Gaussian) -> Stage:
    """Return a stage with its parameters refitted under another prior; as it was where its runs leave all bounds."""
    try:
        fitted = log.fit(prior, stage.terms, stage.posterior.values, stage.added or None)
    except DivergenceError:
        return stage
    return replace(stage, posterior=fitted)
