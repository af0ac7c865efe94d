"""The corrected model: each cause put into it in turn, and kept where it stands on days that no fit has seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from igrow.core.bundle import EffectRecord, Estimate, HeldOutError, Onset, Span
from igrow.core.effects import EFFECTS
from igrow.core.local_time import utc_datetime
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.answer.result import DISCREPANCY, Finding
from igrow.trainer.diagnosis.design import freerun
from igrow.trainer.diagnosis.design.candidates import Pattern, pattern_fluxes
from igrow.trainer.diagnosis.design.freerun import LogDays, Refittable, Stage, cross_validated_skill
from igrow.trainer.diagnosis.knowledge import Knowledge, activate
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.refit import REGIMES
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.validation.confirmation import confirmed
from igrow.trainer.diagnosis.visible_parameters import members
from igrow.trainer.fit.growth import Canopy, growth_since
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.solver import DivergenceError


@dataclass(frozen=True)
class Corrected:
    """The stages of a correction, and the causes that stand."""

    stages: Mapping[str, Stage]
    kept: tuple[Estimated, ...]
    parameter: ParameterChange | None = None
    """One that has changed, where no effect is missing."""
    refused: Stage | None = None
    """With a parameter at what the log asks of it, though it is not told."""
    unproven: frozenset[str] = frozenset()
    """Effects that unseen days did not bear out."""


def correct(
    log: LogDays,
    knowledge: Knowledge,
    found: Sequence[Estimated],
    patterns: Sequence[Hypothesis],
    longitude: float,
    rules: DecisionRules,
) -> Corrected:
    """Fit the model with each cause in turn, and keep those that stand on unseen days.

    Args:
        log: of the diagnosis.
        knowledge: of the model in force.
        found: causes, in the order in which they were found.
        patterns: what no cause explains.
        longitude: degrees east.
        rules: what a cause must show.
    """
    current = recalibrated = Stage(log.fit(knowledge.prior, knowledge.terms), knowledge.terms)
    kept: list[Estimated] = []
    unproven: set[str] = set()
    for place, one in enumerate(found, 1):
        # It was found beside those before it. Where one of them does not stand, it must gain enough by itself.
        if len(kept) < place - 1 and one.over_null < 1.0:
            continue
        tried = _tried(log, knowledge, one, current, found[place:], rules)
        if tried is not None and is_proven(tried[0], rules):
            judged, current = tried
            kept.append(judged)
        else:
            unproven.add(one.effect)
    if patterns and (fitted := _with_patterns(log, knowledge, current, patterns, longitude, rules)) is not None:
        before, after = log.run(current), log.run(fitted)
        if before is not None and after is not None and freerun.skill(before, after) > 0.0:
            current = fitted
    stages = {
        "deployed": Stage(knowledge.posterior, knowledge.terms),
        "recalibrated": recalibrated,
        "corrected": current,
    }
    return Corrected(stages, tuple(kept), unproven=frozenset(unproven))


def with_unexplained(
    log: LogDays,
    knowledge: Knowledge,
    result: Corrected,
    patterns: Sequence[Hypothesis],
    longitude: float,
    rules: DecisionRules,
) -> tuple[Corrected, tuple[Hypothesis, ...]]:
    """Return a correction with that of several patterns which makes free runs of unseen days best, and this pattern.

    Where none makes them better, as a cause must, nothing is told: what steps ask for, parameters may follow as well.

    Args:
        log: of the diagnosis.
        knowledge: of the model in force.
        result: of the correction, with nothing found.
        patterns: that unseen days tell by their steps.
        longitude: degrees east.
        rules: what a pattern must remove, and the bound of its amplitude.
    """
    recalibrated, prior = result.stages["recalibrated"], knowledge.prior
    told, largest = (result, tuple[Hypothesis, ...]()), rules.least_skill
    for one in patterns:
        fitted = _with_patterns(log, knowledge, recalibrated, (one,), longitude, rules)
        if fitted is None:
            continue
        try:
            skill = cross_validated_skill(log, Refittable(recalibrated, prior), Refittable(fitted, prior))
        except DivergenceError:
            continue
        if skill is not None and skill >= largest:
            told, largest = (replace(result, stages={**result.stages, "corrected": fitted}), (one,)), skill
    return told


def _tried(
    log: LogDays,
    knowledge: Knowledge,
    one: Estimated,
    current: Stage,
    later: Sequence[Estimated],
    rules: DecisionRules,
) -> tuple[Estimated, Stage] | None:
    """Return a cause as unseen days judge it, and the model with it; None where free runs refuse it.

    Args:
        log: of the diagnosis.
        knowledge: of the model in force.
        one: the cause.
        current: the model so far.
        later: causes that were found after it.
        rules: what a cause must show.
    """
    # Where the effect takes over what recalibration had put into the parameters, the fit starts there.
    begin = {name: value + one.shift.get(name, 0.0) for name, value in current.posterior.values.items()}
    try:
        asked = confirmed(log, knowledge, current.terms, (one, *later), rules)
        if asked is None:
            return None
        terms = (*current.terms, asked.term)
        trial = Stage(log.fit(knowledge.prior, terms, begin), terms)
        return _judged(log, knowledge, asked, current, trial), trial
    except DivergenceError:
        return None


def is_proven(one: Estimated, rules: DecisionRules) -> bool:
    """Tell whether a cause stands, alone or beside others: a day ahead is better, and the shipped model no worse."""
    if one.effect_to_noise < rules.least_effect_to_noise or not same_in_all_regimes(one.regimes, rules):
        return False
    far_beyond_null = one.over_null >= rules.far_over_null
    enough = rules.least_skill if far_beyond_null else rules.clear_skill
    return one.change_skill >= enough and one.skill >= 0.0


def until_outdone(kept: Sequence[Estimated]) -> tuple[Sequence[Estimated], tuple[Hypothesis, ...]]:
    """Return the causes before the first that a pattern outdoes, and that pattern; all causes where none is outdone.

    That name is borrowed, and what was found beside it may be too.
    """
    for place, one in enumerate(kept):
        if one.outdone_by is not None:
            return kept[:place], (one.outdone_by,)
    return kept, ()


def same_in_all_regimes(regimes: Mapping[str, Estimate], rules: DecisionRules) -> bool:
    """Tell whether a cause's size may be about the same by day and by night, in calm and in wind, and so on.

    A regime in which the effect hardly shows has no size of its own, and one in which it shows little has none that
    speaks against another: at night an error by the sun may be anything.
    """
    pairs = ((regimes[one], regimes[other]) for one, other in REGIMES if one in regimes and other in regimes)
    return not any(_are_apart(one, other, rules.regime_share) for one, other in pairs)


def _are_apart(one: Estimate, other: Estimate, share: float) -> bool:
    """Tell whether the lesser of two sizes is surely less than a share of the larger."""
    lesser, larger = sorted((one, other), key=lambda size: abs(size.value))
    short = share * abs(larger.value) - math.copysign(1.0, larger.value) * lesser.value
    return short > 0.5 * math.hypot(lesser.high - lesser.low, share * (larger.high - larger.low))


def _judged(log: LogDays, knowledge: Knowledge, one: Estimated, current: Stage, trial: Stage) -> Estimated:
    """Return the cause with its skill on unseen days, and how large it is on all of them.

    What comes on few days, as rain does, may hardly have come on those that no fit has seen.
    """
    every = log.all_held_out()
    plain, moved = every.run(replace(trial, terms=current.terms)), every.run(trial)
    prior = knowledge.prior
    skill = cross_validated_skill(log, Refittable(current, prior), Refittable(trial, prior))
    if skill is None or plain is None or moved is None:
        return one
    return replace(one, effect_to_noise=freerun.effect_to_noise(plain, moved), skill=skill)


def _with_patterns(
    log: LogDays,
    knowledge: Knowledge,
    current: Stage,
    patterns: Sequence[Hypothesis],
    longitude: float,
    rules: DecisionRules,
) -> Stage | None:
    """Return the stage fitted beside bounded fluxes on outside drivers; None where its runs leave all bounds."""
    amplitudes = {
        one.cause: float(np.clip(one.amplitude, -rules.largest_pattern, rules.largest_pattern))
        for one in patterns
        if isinstance(one.cause, Pattern)
    }
    added = pattern_fluxes(log.record, longitude, amplitudes)
    try:
        fitted = log.fit(knowledge.prior, current.terms, current.posterior.values, added)
    except DivergenceError:
        return None
    return Stage(fitted, current.terms, amplitudes, added)


def corrected_model(
    model: FittedModel,
    result: Corrected,
    findings: Sequence[Finding],
    errors: Mapping[str, Mapping[str, Mapping[str, float]]],
    span: tuple[np.datetime64, np.datetime64],
    crop: CropStages,
) -> FittedModel:
    """Return a model with what a diagnosis found, ready to export.

    Args:
        model: in force.
        result: of the correction.
        findings: of the diagnosis.
        errors: quantity -> horizon -> stage -> mean absolute error.
        span: of the log.
        crop: its growth, beside the corrected parameters.
    """
    found = tuple(effect_record(one) for one in findings if one.effect in EFFECTS)
    replaced = {one.name for one in found}
    return model.corrected(
        result.stages["corrected"].posterior,
        (*(one for one in model.effects if one.name not in replaced), *found),
        span=Span(*map(utc_datetime, span)),
        errors=[
            HeldOutError(quantity, horizon, stages["deployed"], stages["corrected"], QUANTITIES[quantity].unit)
            for quantity, horizons in errors.items()
            for horizon, stages in horizons.items()
        ],
        crop=crop,
    )


def without(stage: Stage, finding: Finding) -> Stage:
    """Return a stage without what was found: neither the effect, nor the change of a parameter, nor a pattern."""
    if finding.effect == DISCREPANCY:
        return replace(stage, added={})
    if finding.kind != "parameter":
        return replace(stage, terms=tuple(term for term in stage.terms if term.effect != finding.effect))
    posterior, changed = stage.posterior, members(finding.effect)
    here = np.array([name in changed for name in posterior.names])
    return replace(stage, posterior=posterior.moved(posterior.mean / (1.0 + here * finding.parameters["change"].value)))


def corrected_crop(
    log: Log, record: Record, knowledge: Knowledge, corrected: Stage, findings: Sequence[Finding], before: CropStages
) -> CropStages:
    """Return how the crop grows, beside the corrected parameters and with what was found to be missing.

    Args:
        log: of the diagnosis, with its counts.
        record: of it.
        knowledge: of the model in force.
        corrected: the stage that comes of it.
        findings: what was told.
        before: how it grew by the model in force.
    """
    found = {one.effect for one in findings}
    plain = reduce(without, findings, corrected)
    # What was known to be missing before it was found to be more of it.
    plain = replace(plain, terms=(*plain.terms, *(one for one in knowledge.terms if one.effect in found)))

    def canopy(stage: Stage) -> Canopy:
        return Canopy(stage.posterior.values, activate(record, stage.terms))

    was = Stage(knowledge.posterior, knowledge.terms)
    return growth_since(log, record, canopy(was), canopy(corrected), canopy(plain), before)


def effect_record(finding: Finding) -> EffectRecord:
    """Return a finding of the catalogue as the manifest's record of an effect."""
    began = finding.onset
    onset = None if began is None else Onset(*map(utc_datetime, (began.time, began.low, began.high)))
    kind, parameters = EFFECTS[finding.effect].kind, dict(finding.parameters)
    return EffectRecord(finding.effect, kind, parameters, finding.balances, onset, finding.confounded[1:])
