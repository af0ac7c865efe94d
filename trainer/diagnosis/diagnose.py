"""From a log to the verdict, each stage entered once a round.

log, model --> knowledge --> actuators --> design --> compare --> estimate --> refit --+--> correct --> Diagnosis
                                             ^                                         |
                                             +------------ the cause put in -----------+

Beside the causes it is asked which parameter has changed; of one that began within the log the days since then are
diagnosed by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis import history, wording
from igrow.trainer.diagnosis.actuators import REPLACEABLE, Completed, complete
from igrow.trainer.diagnosis.candidates import hidden_by_missing_weather
from igrow.trainer.diagnosis.correction import Corrected, correct, corrected_model, with_parameter
from igrow.trainer.diagnosis.diagnosed_days import newest_weeks, since_calibration
from igrow.trainer.diagnosis.drift import Drift
from igrow.trainer.diagnosis.estimate import normal_quantile
from igrow.trainer.diagnosis.evidence import Evidence
from igrow.trainer.diagnosis.freerun import HORIZONS, FreeRuns, LogDays, Stage, log_days, mean_absolute_errors
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.nuisance import NuisanceSubspace
from igrow.trainer.diagnosis.open_vents import under_open_vents
from igrow.trainer.diagnosis.parameter_change import ParameterChange
from igrow.trainer.diagnosis.result import Diagnosis, Finding, Verdict
from igrow.trainer.diagnosis.rounds import search_of
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.fit.growth import built_in_crop, growth_since
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.given import MADE, READ, must_be
from igrow.trainer.progress import Progress, silent


def diagnose(
    log: Log,
    model: FittedModel,
    *,
    without: Collection[str] = (),
    seed: int = 0,
    rules: DecisionRules = DEFAULT,
    nuisance: NuisanceSubspace | None = None,
    drift: Drift | None = None,
    progress: Progress = silent,
) -> Diagnosis:
    """Return the diagnosis of a log.

    Args:
        log: of the greenhouse; gaps and missing columns are allowed. Days that the model was calibrated on are left
            out where a week is later.
        model: in force.
        without: effects that are not to be considered.
        seed: of the random flips and bootstraps.
        rules: every threshold.
        nuisance: what greenhouses show though nothing is missing (None: what came with the trainer).
        drift: how greenhouses like it change with time (None: what came with the trainer).
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: the log is shorter than a week, or lacks outdoor or air temperature.
    """
    must_be(Log, log, READ)
    must_be(FittedModel, model, MADE)
    without = (without,) if isinstance(without, str) else without
    for name in without:
        if name not in EFFECTS:
            raise IgrowError(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
    site = log.known_site
    if log.faults:
        return _data_fault(log, model)
    log.require("a diagnosis", rules.least_days)
    knowledge = knowledge_of(model, site, rules)
    since, notes = since_calibration(log, model, rules)
    log = newest_weeks(since, knowledge, rules)
    progress("completing the log")
    logged, rng = log_days(log, model), np.random.default_rng(seed)
    completed = complete(log, logged, model, knowledge, rules)
    days, opened = completed.days, under_open_vents(logged.record, rules)
    off = opened is not None and opened.is_offset(rules)
    hidden = frozenset(without) | (frozenset({"co2_drift"}) if off else frozenset())
    search = search_of(days, site, knowledge, hidden, rules, nuisance, drift)
    progress("searching for causes")
    first, last, found = search.run(rng)
    rivals = hidden_by_missing_weather(first.design.line)
    found = [replace(one, confounded=(*one.confounded, *rivals)) for one in found]
    # A parameter can stand in for an actuator that the log lacks, found or not.
    lacking = not set(REPLACEABLE).isdisjoint(logged.record.missing)
    parameter = None if lacking else search.changed_parameter(rng)
    patterns = last.patterns
    if parameter is not None and parameter.onset is not None:
        if parameter.leads or not (found or patterns):
            again = partial(
                diagnose, model=model, without=without, seed=seed, rules=rules, nuisance=nuisance, drift=drift,
                progress=progress,
            )  # fmt: skip
            told = _since(parameter, log.select(parameter.onset.time), again, rules)
            if told is not None:
                return replace(told, notes=tuple(dict.fromkeys((*notes, *told.notes))))
        # What the days since then alone do not bear out, or are too few to, is left to a later log.
        parameter = None
    if parameter is not None and parameter.leads:
        found, patterns = [], ()
    progress("correcting the model")
    result = correct(days, knowledge, found, patterns, site.longitude, rules)
    if parameter is not None and not (result.kept or patterns):
        result = with_parameter(days, knowledge, result, parameter, rules)
    verdict, findings = _verdict(completed, result, patterns, rules)
    stages = _stages(result, completed, logged)
    progress("predicting unseen days")
    runs = _runs(stages)
    errors = _errors(runs)
    start, end = log.telemetry.time[0], log.telemetry.time[-1]
    moved = model.posterior.values, result.stages["corrected"].posterior.values
    crop = growth_since(log, days.record, moved, model.crop or built_in_crop())
    corrected = corrected_model(model, result, findings, errors, knowledge.discrepancy, (start, end), crop)
    notes = (
        *notes,
        *((wording.NOT_CALIBRATED,) if knowledge.transferred else ()),
        *((wording.NEWEST,) if log is not since else ()),
        *wording.thin_air(site),
        *((opened.sentence,) if opened is not None and off else ()),
    )
    possible = {name for one in findings for name in one.confounded}
    return Diagnosis(
        site=site.name,
        verdict=verdict,
        start=start,
        end=end,
        fit_days=int(days.split.fit.sum()),
        held_out_days=int((~days.split.fit).sum()),
        findings=findings,
        errors=errors,
        screened=log.screened,
        model=model,
        corrected=remembering(corrected, result.parameter, rules),
        # What a cause may as well be is told already.
        untestable=tuple(name for name in first.design.untestable if name not in possible),
        missing=logged.record.missing,
        notes=notes,
        evidence=Evidence(
            days, knowledge, first, result.estimates, {name: stage for name, (stage, _) in stages.items()}, runs["24_h"]
        ),
        log=log,
    )


def _since(
    change: ParameterChange, later: Log, again: Callable[[Log], Diagnosis], rules: DecisionRules
) -> Diagnosis | None:
    """Return the diagnosis of the days since a parameter has changed; None where these alone do not bear it out.

    One set of parameters is none for a log of two greenhouses: the one that is there now counts.

    Args:
        change: with its beginning, by the whole log.
        later: the days since.
        again: the diagnosis of them.
        rules: how many they must be.
    """
    if later.days < rules.least_days:
        return None
    told = again(later)
    return begun(told, change) if any(one.effect == change.parameter for one in told.findings) else None


def begun(later: Diagnosis, change: ParameterChange) -> Diagnosis:
    """Return the diagnosis of the days since a parameter has changed, with the beginning that the whole log tells."""
    findings = tuple(
        wording.parameter(replace(change, share=one.parameters["change"], confounded=one.confounded))
        if one.effect == change.parameter
        else one
        for one in later.findings
    )
    return replace(later, findings=findings, notes=(*later.notes, wording.SINCE))


def remembering(model: FittedModel, change: ParameterChange | None, rules: DecisionRules) -> FittedModel:
    """Return a model whose history knows that a parameter has changed, so that it is no news in the next log."""
    if change is None or model.history is None:
        return model
    value, share = model.history.parameters[change.parameter], change.share
    deviation = 0.5 * (share.high - share.low) / normal_quantile(rules) * abs(value)
    return replace(model, history=history.followed(model.history, change.parameter, share.value * value, deviation))


def _verdict(
    completed: Completed, result: Corrected, patterns: Sequence[Hypothesis], rules: DecisionRules
) -> tuple[Verdict, tuple[Finding, ...]]:
    findings = (
        *(wording.actuator(one) for one in completed.found),
        *(wording.finding(one) for one in sorted(result.kept, key=lambda one: -one.effect_to_noise)),
        *(() if result.parameter is None else (wording.parameter(result.parameter),)),
    )
    if patterns:
        return "unexplained", (*findings, wording.discrepancy(patterns, rules))
    if not findings:
        return "nothing", ()
    return ("ambiguous" if any(len(one.confounded) > 1 for one in findings) else "named"), findings


def _stages(result: Corrected, completed: Completed, logged: LogDays) -> dict[str, tuple[Stage, LogDays]]:
    """Return every stage with the log that it sees: an actuator that the log lacks counts from the correction on."""
    stages = {name: (stage, completed.days) for name, stage in result.stages.items()}
    if completed.recalibrated is not None:
        stages |= {
            "deployed": (result.stages["deployed"], logged),
            "recalibrated": (completed.recalibrated, logged),
        }
    return stages


def _runs(stages: Mapping[str, tuple[Stage, LogDays]]) -> dict[str, dict[str, FreeRuns]]:
    """Return the free runs on held-out days: horizon -> stage, where one fits."""
    return {
        horizon: {name: run for name, (stage, seen) in stages.items() if (run := seen.run(stage, horizon)) is not None}
        for horizon in HORIZONS
    }


def _errors(runs: Mapping[str, Mapping[str, FreeRuns]]) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon, by_stage in runs.items():
        for name, run in by_stage.items():
            for quantity, error in mean_absolute_errors(run).items():
                table.setdefault(quantity, {}).setdefault(horizon, {})[name] = error
    return table


def _data_fault(log: Log, model: FittedModel) -> Diagnosis:
    time, notes = log.telemetry.time, tuple(map(str, log.faults))
    return Diagnosis(
        log.known_site.name, "data_fault", time[0], time[-1], 0, 0, (), {}, log.screened, model, model,
        notes=notes, log=log,
    )  # fmt: skip
