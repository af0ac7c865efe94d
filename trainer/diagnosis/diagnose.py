"""From a log to the verdict, each stage entered once a round.

log, model --> knowledge --> design --> compare --> estimate --> refit --+--> correct --> findings --> Diagnosis
                               ^                                         |
                               +------------ the cause put in -----------+
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.language import N_
from igrow.trainer.data.log import Log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import freerun, history, sensitivity, wording
from igrow.trainer.diagnosis.actuators import REPLACEABLE, Completed, complete
from igrow.trainer.diagnosis.candidates import hidden_by_missing_weather
from igrow.trainer.diagnosis.correction import Corrected, LogDays, Stage, correct, corrected_model, with_parameter
from igrow.trainer.diagnosis.design import prepare
from igrow.trainer.diagnosis.drift import Drift
from igrow.trainer.diagnosis.estimate import normal_quantile
from igrow.trainer.diagnosis.evidence import Evidence
from igrow.trainer.diagnosis.knowledge import activate, knowledge_of
from igrow.trainer.diagnosis.nuisance import NuisanceSubspace, learn_discrepancy
from igrow.trainer.diagnosis.open_vents import under_open_vents
from igrow.trainer.diagnosis.parameter_change import ParameterChange
from igrow.trainer.diagnosis.result import Diagnosis, Finding, Verdict
from igrow.trainer.diagnosis.rounds import search_of
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.growth import built_in_crop, growth_since
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.population import Population

Report = Callable[[str], None]
NOT_CALIBRATED = N_(
    "What the model misses of this greenhouse when all is well is not known, so only large causes can be told from a "
    "greenhouse that is another: calibrate it on weeks that are known to be good (igrow-trainer calibrate)."
)
NEWEST = N_(
    "Within more than six weeks a crop changes: what has changed since the calibration was looked for in the newest "
    "six."
)
SINCE = N_("The errors are of the days since then: before, the greenhouse was another.")


def diagnose(
    log: Log,
    model: FittedModel,
    *,
    without: Collection[str] = (),
    seed: int = 0,
    rules: DecisionRules = DEFAULT,
    nuisance: NuisanceSubspace | None = None,
    drift: Drift | None = None,
    progress: Report | None = None,
) -> Diagnosis:
    """Return the diagnosis of a log.

    Args:
        log: of the greenhouse; gaps and missing columns are allowed.
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
    for name in without:
        if name not in EFFECTS:
            raise IgrowError(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
    site = log.known_site
    if log.faults:
        return _data_fault(log, model)
    log.require("a diagnosis", rules.least_days)
    given, log = log, newest_weeks(log, model, rules)
    say = progress or (lambda _line: None)
    say("completing the log")
    knowledge = knowledge_of(model, site, rules)
    logged, rng = log_days(log, model), np.random.default_rng(seed)
    completed = complete(log, logged, model, knowledge, rules)
    days, opened = completed.days, under_open_vents(logged.record, rules)
    off = opened is not None and opened.is_offset(rules)
    hidden = frozenset(without) | (frozenset({"co2_drift"}) if off else frozenset())
    search = search_of(days, site, model, knowledge, hidden, rules, nuisance, drift)
    say("searching for causes")
    first, last, found = search.run(rng)
    rivals = hidden_by_missing_weather(first.design.line)
    found = [replace(one, confounded=(*one.confounded, *rivals)) for one in found]
    # A parameter can stand in for an actuator that the log lacks, found or not.
    lacking = not set(REPLACEABLE).isdisjoint(logged.record.missing)
    parameter = None if lacking else search.changed_parameter(rng)
    patterns = last.patterns
    if parameter is not None and parameter.onset is not None:
        if parameter.leads or not (found or patterns):
            # One set of parameters is none for a log of two greenhouses: the one that is there now counts.
            later = log.select(parameter.onset.time)
            if later.days >= rules.least_days:
                told = diagnose(
                    later, model, without=without, seed=seed, rules=rules, nuisance=nuisance, drift=drift,
                    progress=progress,
                )  # fmt: skip
                if any(one.effect == parameter.parameter for one in told.findings):
                    return begun(told, parameter)
        # What the days since then alone do not bear out, or are too few to, is left to a later log.
        parameter = None
    if parameter is not None and parameter.leads:
        found, patterns = [], ()
    say("correcting the model")
    result = correct(days, knowledge, found, patterns, site.longitude, rules)
    if parameter is not None and not (result.kept or patterns):
        result = with_parameter(days, knowledge, result, parameter, rules)
    verdict, findings = _verdict(completed, result, patterns, rules)
    stages = _stages(result, completed, logged)
    say("predicting unseen days")
    errors = _errors(stages)
    start, end = log.telemetry.time[0], log.telemetry.time[-1]
    moved = model.posterior.values, result.stages["corrected"].posterior.values
    crop = growth_since(log, days.record, moved, model.crop or built_in_crop())
    runs = {name: day for name, (stage, seen) in stages.items() if (day := seen.run(stage)) is not None}
    corrected = corrected_model(model, result, findings, errors, knowledge.discrepancy, (start, end), crop)
    notes = (
        *((NOT_CALIBRATED,) if knowledge.transferred else ()),
        *((NEWEST,) if log is not given else ()),
        *((opened.sentence,) if opened is not None and off else ()),
    )
    return Diagnosis(
        site.name,
        verdict,
        start,
        end,
        int(days.split.fit.sum()),
        int((~days.split.fit).sum()),
        findings,
        errors,
        log.screened,
        model,
        remembering(corrected, result.parameter, rules),
        first.design.untestable,
        logged.record.missing,
        notes,
        Evidence(days, knowledge, first, result.estimates, {name: stage for name, (stage, _) in stages.items()}, runs),
        log,
    )


def begun(later: Diagnosis, change: ParameterChange) -> Diagnosis:
    """Return the diagnosis of the days since a parameter has changed, with the beginning that the whole log tells."""
    findings = tuple(
        wording.parameter(replace(change, share=one.parameters["change"], confounded=one.confounded))
        if one.effect == change.parameter
        else one
        for one in later.findings
    )
    return replace(later, findings=findings, notes=(*later.notes, SINCE))


def remembering(model: FittedModel, change: ParameterChange | None, rules: DecisionRules) -> FittedModel:
    """Return a model whose history knows that a parameter has changed, so that it is no news in the next log."""
    if change is None or model.history is None:
        return model
    value, share = model.history.parameters[change.parameter], change.share
    deviation = 0.5 * (share.high - share.low) / normal_quantile(rules) * abs(value)
    return replace(model, history=history.followed(model.history, change.parameter, share.value * value, deviation))


def newest_weeks(log: Log, model: FittedModel, rules: DecisionRules) -> Log:
    """Return the newest weeks of a long log where its greenhouse's history can be asked what has changed, else all."""
    known = rules.history and model.history is not None and model.calibrated_on == log.known_site.name
    if not known or log.days <= rules.long_days:
        return log
    # So many local days at most, the first and the last of them cut.
    return log.select(log.telemetry.time[-1] - np.timedelta64(round((rules.long_days - 1.0) * 86_400.0), "s"))


def discrepancy_of(log: Log, model: FittedModel, rules: DecisionRules = DEFAULT) -> dict[str, float]:
    """Return what a calibrated model misses on its own calibration log, for `FittedModel.discrepancy`.

    Raises:
        DivergenceError: the model runs out of all bounds on it.
    """
    site, days = log.known_site, log_days(log, model)
    knowledge = knowledge_of(model, site, rules)
    effects = activate(days.record, knowledge.terms)
    design = prepare(days.record, days.split, knowledge.prior, effects, site.longitude, rules, discrepancy={})
    return learn_discrepancy(design)


def history_of(
    log: Log, model: FittedModel, rules: DecisionRules = DEFAULT, *, population: Population | None = None
) -> Discrepancy:
    """Return the same with covariance and the noise's colour, for `FittedModel.history`; raises as above does."""
    record, site = log_days(log, model).record, log.known_site
    effects = activate(record, knowledge_of(model, site, rules).terms)
    return history.learn(record, site, model.posterior, rules, population, effects)


def log_days(log: Log, model: FittedModel) -> LogDays:
    """Return the record of a log as a model reads it, split into days, with its runs."""
    shift = log.best_shift(model.posterior.values) if model.alignment is None else model.alignment
    record = log.record(shift)
    split = split_days(record, log.known_site.longitude)
    return LogDays(record, split, sensitivity.day_runs(record, split.day))


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


def _errors(stages: Mapping[str, tuple[Stage, LogDays]]) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon in freerun.HORIZONS:
        for name, (stage, seen) in stages.items():
            for quantity, error in freerun.mean_absolute_errors(seen.run(stage, horizon)).items():
                table.setdefault(quantity, {}).setdefault(horizon, {})[name] = error
    return table


def _data_fault(log: Log, model: FittedModel) -> Diagnosis:
    time, notes = log.telemetry.time, tuple(map(str, log.faults))
    return Diagnosis(
        log.known_site.name, "data_fault", time[0], time[-1], 0, 0, (), {}, log.screened, model, model,
        notes=notes, log=log,
    )  # fmt: skip
