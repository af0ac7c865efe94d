"""A parameter that has changed beside the causes that explain a log as well: which of both stands on unseen days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import freerun
from igrow.trainer.diagnosis.design.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.estimate import Estimated, normal_quantile
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.validation.correction import Corrected
from igrow.trainer.diagnosis.visible_parameters import members
from igrow.trainer.fit.climate import bounds
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError

_AT_BOUND = 1e-3
"""Share of its range within which a parameter lies on its bound."""


def may_give_way(kept: Sequence[Estimated]) -> bool:
    """Tell whether a parameter may be told in the place of causes: of faults of sensors, or none.

    A cause in a balance has twins among the parameters, which follow it nearly as well: it stays.
    """
    return all(EFFECTS[one.effect].kind == "sensor" for one in kept)


def with_parameter(
    log: LogDays,
    knowledge: Knowledge,
    result: Corrected,
    parameter: ParameterChange,
    rivals: Sequence[ActiveTerm],
    rules: DecisionRules,
) -> Corrected:
    """Return a correction with a parameter that has changed, where it alone makes unseen days better.

    Recalibration may have followed the change: it stays where freeing the parameter beside it adds nothing.

    Args:
        log: of the diagnosis.
        knowledge: of the model in force.
        result: so far; faults of sensors are all that may have been kept.
        parameter: by the search.
        rivals: faults of sensors that explain the log as well. They go where the parameter alone makes unseen days
            clearly better than they do: the search is linear, and much of a large change looks to it like a sensor
            that reads by a share too little.
        rules: what must be shown.
    """
    known, recalibrated = knowledge.posterior, result.stages["recalibrated"]
    changed = np.array([name in members(parameter.parameter) for name in known.names])
    by_physics = knowledge.by_physics(rules)
    faults = (*recalibrated.terms, *rivals)
    try:
        without, faulty, alone, beside = (
            Refittable(Stage(log.fit(prior, terms), terms), prior)
            for prior, terms in (
                (by_physics, recalibrated.terms),
                (by_physics, faults),
                (by_physics.widened_along(known.mean * changed), recalibrated.terms),
                (knowledge.prior.widened_along(known.mean * changed), recalibrated.terms),
            )
        )
        over_none = cross_validated_skill(log, without, alone)
        over_faults = cross_validated_skill(log, faulty, alone) if rivals else over_none
        shipped = cross_validated_skill(log, Refittable(recalibrated, knowledge.prior), beside)
    except DivergenceError:
        return result
    refused = replace(result, refused=alone.stage)
    if over_none is None or over_faults is None or shipped is None:
        return refused if rivals else replace(result, parameter=parameter)
    if min(over_none, over_faults) < rules.least_skill:
        return refused
    fitted = _sized(parameter, known, alone.stage.posterior, rules)
    if fitted is None:
        return refused
    corrected = beside.stage if shipped >= 0.0 else recalibrated
    return replace(result, stages={**result.stages, "corrected": corrected}, kept=(), parameter=fitted)


def _sized(change: ParameterChange, before: Gaussian, after: Gaussian, rules: DecisionRules) -> ParameterChange | None:
    """Return a change with its size by a fit, the search being linear; None where it is too small or at a bound.

    Args:
        change: as the search saw it.
        before: the parameters at the calibration.
        after: fitted to the log, those that have changed free.
        rules: the least change.
    """
    now, names = after.marginal(members(change.parameter)), members(change.parameter)
    was, (low, high) = before.marginal(names).mean, bounds(names)
    edge = _AT_BOUND * (high - low)
    share, least = float(np.mean(now.mean / was - 1.0)), rules.least_parameter_change(leads=change.leads)
    if np.any((now.mean <= low + edge) | (now.mean >= high - edge)) or abs(share) < least:
        return None
    weights = 1.0 / (len(names) * was)
    deviation = float(np.sqrt(weights @ now.covariance @ weights))
    wide = max(normal_quantile(rules) * deviation, 0.5 * (change.share.high - change.share.low))
    return replace(change, share=Estimate.about(share, wide, change.share.unit))


def stands_in_its_place(
    log: LogDays,
    beside: Corrected,
    patterns: Sequence[Hypothesis],
    result: Corrected,
    parameter: ParameterChange,
    rules: DecisionRules,
) -> bool:
    """Tell whether what the search told beside a parameter that leads is told in its place.

    Args:
        log: of the diagnosis.
        beside: with what the search told.
        patterns: that it told.
        result: with the parameter where unseen days bear it out, without it where they do not.
        parameter: by the search.
        rules: what must be shown.
    """
    found, as_well = beside.stages["corrected"], bool(patterns) or explains_as_well(beside.kept, parameter, rules)
    if result.parameter is not None:
        return as_well and predicts_better(log, found, result.stages["corrected"], rules)
    if as_well or not beside.kept or result.refused is None:
        return as_well
    # A search is linear: by it a parameter that would have to leave its bounds gains more than there is to gain.
    return predicts_better(log, found, result.refused, rules)


def explains_as_well(kept: Sequence[Estimated], parameter: ParameterChange, rules: DecisionRules) -> bool:
    """Tell whether causes explain so much of a log that they may stand in the place of a parameter that leads.

    Where they explain far less they stand in for a part of its change, though unseen days did not bear it out either.
    """
    return rules.most_parameter_over_found * sum(one.gain for one in kept) >= parameter.gain


def predicts_better(log: LogDays, one: Stage, other: Stage, rules: DecisionRules) -> bool:
    """Tell whether a model predicts days that no fit has seen clearly better than another."""
    before, after = log.run(other), log.run(one)
    return before is not None and after is not None and freerun.skill(before, after) >= rules.clear_skill
