"""A change asked once more, of free runs: what its size is, and whether days that no fit has seen are better for it.

Parameters may move as physics lets a greenhouse change, and no further. In a model that is shipped they may move more,
and then follow what is missing: a day ahead is nearly as good without its name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, activate
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.search.omission import fit_together
from igrow.trainer.fit.climate import has_runs
from igrow.trainer.fit.gaussian import Gaussian


def confirmed(
    log: LogDays, knowledge: Knowledge, standing: Sequence[ActiveTerm], asked: Sequence[Estimated], rules: DecisionRules
) -> Estimated | None:
    """Return the first of some changes with its size by free runs, and its skill; None where time steps tell another.

    Args:
        log: of the diagnosis.
        knowledge: of the greenhouse before it.
        standing: terms that the model has: of two causes one cannot do for both.
        asked: the change, as time steps tell it, and those that are to be asked after it.
        rules: how far both sizes may be apart.

    Raises:
        DivergenceError: the model runs out of all bounds with them.
    """
    prior = knowledge.by_physics(rules)
    one, *later = asked
    # Where parameters may be anything, free runs leave a cause what belongs to them, or take it from it.
    sizes = None
    if knowledge.history is not None:
        sizes = _by_runs(log, prior, standing, [change.term for change in asked], rules)
    if sizes is not None:
        share = sizes[0] / one.term.amplitude
        if share <= 0.0 or min(share, 1.0 / share) < rules.regime_share:
            return None
        one, *later = (_at(change, size) for change, size in zip(asked, sizes, strict=True))
    beside = (*standing, *(change.term for change in later))
    without, named = (Stage(log.fit(prior, terms), terms) for terms in (beside, (*beside, one.term)))
    skill = cross_validated_skill(log, Refittable(without, prior), Refittable(named, prior, sized=True))
    return one if skill is None else replace(one, change_skill=skill)


def _by_runs(
    log: LogDays, prior: Gaussian, standing: Sequence[ActiveTerm], asked: Sequence[ActiveTerm], rules: DecisionRules
) -> list[float] | None:
    """Return the sizes that the free runs of the fitted days ask for, since the latest beginning within the log.

    None where there are too few days since then, or none that is complete, or where something drifts from its beginning
    on: it has no one size.
    """
    record, every = log.record, (*standing, *asked)
    begun = [one.onset for one in every if one.onset is not None]
    if any(one.onset is not None and "elapsed_days" in EFFECTS[one.effect].drivers for one in every):
        return None
    since = record.time >= max(begun, default=record.time[0])
    rows = log.split.fit_rows & since
    if since.sum() * record.step < rules.least_days * 86_400.0 or not has_runs(record, rows):
        return None
    known = {
        **activate(record, [replace(one, onset=None) for one in standing]),
        **{one.effect: dict(one.shape) for one in asked},
    }
    sizes = {one.effect: one.amplitude for one in asked}
    fitted = fit_together(record, rows, prior, sizes, known).values
    return [fitted[f"{name}:{EFFECTS[name].amplitude.name}"] for name in sizes]


def _at(one: Estimated, size: float) -> Estimated:
    """Return a change at another size, as surely known as it was."""
    scale, was = size / one.term.amplitude, one.amplitude
    ends = sorted((was.low * scale, was.high * scale))
    amplitude = replace(was, value=was.value * scale, low=ends[0], high=ends[1])
    return replace(one, term=replace(one.term, amplitude=size), amplitude=amplitude)
