"""A change asked once more, of free runs: what its size is, and whether days that no fit has seen are better for it.

Parameters may move as physics lets a greenhouse change, and no further. In a model that is shipped they may move more,
and then follow what is missing: a day ahead is nearly as good without its name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.estimate import Estimated
from igrow.trainer.diagnosis.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, activate
from igrow.trainer.diagnosis.omission import fit_together
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.gaussian import Gaussian


def confirmed(
    log: LogDays, knowledge: Knowledge, beside: Sequence[ActiveTerm], one: Estimated, rules: DecisionRules
) -> Estimated | None:
    """Return a change with the size that time steps and free runs agree on, and its skill; None where they do not.

    Args:
        log: of the diagnosis.
        knowledge: of the greenhouse before it.
        beside: terms that the model has, and all else that was found: of two causes one cannot do for both.
        one: the change, as time steps tell it.
        rules: how far both may be apart.

    Raises:
        DivergenceError: the model runs out of all bounds with it.
    """
    prior = knowledge.by_physics(rules)
    size = _by_runs(log, prior, beside, one.term)
    if size is not None:
        both = size * one.term.amplitude
        apart = both <= 0.0 or min(size / one.term.amplitude, one.term.amplitude / size) < rules.regime_share
        if apart:
            return None
        # Neither is better than the other, and they err for different reasons.
        one = _at(one, math.copysign(math.sqrt(both), size))
    without, named = (Stage(log.fit(prior, terms), terms) for terms in (tuple(beside), (*beside, one.term)))
    skill = cross_validated_skill(log, Refittable(without, prior), Refittable(named, prior, sized=True))
    return one if skill is None else replace(one, change_skill=skill)


def _by_runs(log: LogDays, prior: Gaussian, beside: Sequence[ActiveTerm], term: ActiveTerm) -> float | None:
    """Return the size that the free runs of the fitted days ask for; None where something began within the log.

    Of that there is no one size.
    """
    if any(one.onset is not None for one in (*beside, term)):
        return None
    name = f"{term.effect}:{EFFECTS[term.effect].amplitude.name}"
    known = {**activate(log.record, beside), term.effect: dict(term.shape)}
    fitted = fit_together(log.record, log.split.fit_rows, prior, {term.effect: term.amplitude}, known)
    return fitted.values[name]


def _at(one: Estimated, size: float) -> Estimated:
    """Return a change at another size, as surely known as it was."""
    scale, was = size / one.term.amplitude, one.amplitude
    ends = sorted((was.low * scale, was.high * scale))
    amplitude = replace(was, value=was.value * scale, low=ends[0], high=ends[1])
    return replace(one, term=replace(one.term, amplitude=size), amplitude=amplitude)
