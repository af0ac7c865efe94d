"""From a log to the verdict, each stage entered once a round.

log, model --> circumstances --> design --> compare --> estimate --> refit --+--> correct --> Diagnosis
                                   ^                                         |
                                   +------------ the cause put in -----------+

Where unseen days bear no cause out, the search is made again without those that they refuse. Beside the causes it is
asked which parameter has changed; of one that began within the log the days since then are diagnosed by themselves. A
long log is asked in parts, the oldest first.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.answer.answers import Answer, bears_out, begun, is_same
from igrow.trainer.diagnosis.answer.evidence import Evidence
from igrow.trainer.diagnosis.answer.result import Diagnosis, Finding, Verdict
from igrow.trainer.diagnosis.circumstances import Circumstances, circumstances_of
from igrow.trainer.diagnosis.crop import of_one_crop
from igrow.trainer.diagnosis.design.candidates import hidden_by_missing_weather
from igrow.trainer.diagnosis.diagnosed_days import since_calibration, weeks_in_turn, well_read
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT, DecisionRules
from igrow.trainer.diagnosis.search import history
from igrow.trainer.diagnosis.search.actuators import Completed, may_hide_in_parameters
from igrow.trainer.diagnosis.search.change import Round
from igrow.trainer.diagnosis.search.estimate import Estimated, from_before, normal_quantile
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.rounds import Search, search_of
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.validation.correction import (
    Corrected,
    correct,
    corrected_crop,
    corrected_model,
    until_outdone,
    with_unexplained,
)
from igrow.trainer.diagnosis.validation.parameter_or_causes import may_give_way, stands_in_its_place, with_parameter
from igrow.trainer.diagnosis.validation.shipping import shipped
from igrow.trainer.diagnosis.validation.unseen_errors import errors_of, runs_of, stages_of
from igrow.trainer.diagnosis.visible_parameters import members
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.growth import built_in_crop
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
    null_gains: NullGains | None = None,
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
        null_gains: what a change gains where there is none (None: what came with the trainer).
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: the log is shorter than a week, or lacks outdoor or air temperature, or hardly has readings of it.
    """
    must_be(Log, log, READ)
    must_be(FittedModel, model, MADE)
    without = (without,) if isinstance(without, str) else without
    for name in without:
        if name not in EFFECTS:
            raise IgrowError(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
    if log.faults:
        return _data_fault(log, model)
    log.require("a diagnosis", rules.least_days)
    return _Question(model, frozenset(without), seed, rules, null_gains, progress).in_turn(log)


@dataclass(frozen=True)
class _Question:
    """What is asked of a log, and of parts of it; fields as the arguments of `diagnose`."""

    model: FittedModel
    without: frozenset[str]
    seed: int
    rules: DecisionRules
    null_gains: NullGains | None
    progress: Progress
    history: Discrepancy | None = None
    """Of the greenhouse, the weeks before seen too; None of the weeks next to the calibration."""

    def in_turn(self, log: Log) -> Diagnosis:
        """Return the diagnosis of a log: of a long one its weeks in turn, each by what those before it have told."""
        since, notes = since_calibration(log, self.model, self.rules)
        since, left_out = of_one_crop(since, self.rules)
        (first, *later), unread = well_read(weeks_in_turn(since, self.rules))
        told = latest = self.answer(first)
        for number, weeks in enumerate(later, 2):
            self.progress(f"part {number} of {len(later) + 1}")
            earlier = [from_before(one, told.diagnosis.start) for one in told.causes]
            latest = replace(self, history=latest.history).answer(weeks, told.parameter, earlier=earlier)
            if bears_out(latest, told, self.rules):
                told = latest
        beside = (wording.IN_TURN if told is latest else wording.EARLIER,) if later else ()
        return replace(told.diagnosis, notes=(*notes, *left_out, *unread, *told.diagnosis.notes, *beside))

    def answer(
        self,
        log: Log,
        asked: ParameterChange | None = None,
        rivals: Sequence[ActiveTerm] = (),
        earlier: Sequence[Estimated] = (),
    ) -> Answer:
        """Return what a log tells.

        Args:
            log: of a week or more, and not long.
            asked: what other days tell to have changed before this log, where this one alone tells nothing.
            rivals: faults of sensors that explain it there as well.
            earlier: causes that the weeks before it have told.
        """
        progress, site = self.progress, log.known_site
        # What is shipped asks the next log by the calibration.
        seen = self.history or self.model.history
        progress("completing the log")
        around = circumstances_of(log, self.model, seen, self.rules)
        days, knowledge, rules, rng = (
            around.completed.days,
            around.knowledge,
            around.rules,
            np.random.default_rng(self.seed),
        )
        search = self._search(around, site)
        first, last, found, beside = self._borne_out(around, search, rng, earlier)
        # A parameter can stand in for an actuator that the log lacks, found or not.
        hiding = may_hide_in_parameters(around.logged.record.missing)
        waiting = False
        parameter = None if hiding or around.new_crop else search.changed_parameter(rng) or asked
        if parameter is not None and parameter.leads and parameter.onset is not None:
            if (told := self._since(parameter, parameter.onset.time, log)) is not None:
                return told
            # What the days since then alone do not bear out, or are too few to, is left to a later log; of too few days
            # all is left, since what an effect explains of them the parameter explains better.
            waiting = log.select(parameter.onset.time).days < rules.least_days
            parameter = None
        leads = parameter is not None and parameter.leads
        nothing_asked = waiting or around.new_crop
        result, patterns = beside, last.patterns
        if leads or nothing_asked:
            result, patterns = correct(days, knowledge, [], (), site.longitude, rules), ()
        if parameter is not None and not patterns and may_give_way(result.kept):
            # A fault of a sensor that gave way to one that leads is its rival on unseen days all the same.
            told_beside = found if leads and may_give_way(found) else result.kept
            faults = [one.term for one in told_beside] or rivals
            if parameter.onset is None:
                result = with_parameter(days, knowledge, result, parameter, faults, rules)
            elif (told := self._since(parameter, parameter.onset.time, log, faults)) is not None:
                return told
        # What the search told beside a parameter that leads stands where unseen days do not bear that out, or less.
        told_too = leads and not nothing_asked and bool(found or last.patterns)
        if told_too and parameter is not None:
            stands = stands_in_its_place(days, beside, last.patterns, result, parameter, rules)
            result, patterns = (beside, last.patterns) if stands else (result, patterns)
        sure, outdoing = until_outdone(result.kept)
        if outdoing and result.parameter is None and not patterns:
            result, patterns = correct(days, knowledge, sure, outdoing, site.longitude, rules), outdoing
        explained = bool(around.completed.found or result.kept or result.parameter or patterns)
        if not (explained or nothing_asked):
            result, patterns = with_unexplained(days, knowledge, result, search.unexplained(rng), site.longitude, rules)
        followed = remembering(replace(self.model, history=seen), result.parameter, rules).history
        if not (around.new_crop or result.parameter is not None):
            followed = search.history_after(result.kept)
        completed, result = shipped(around.completed, around.logged, knowledge, result)
        diagnosis = self._diagnosis(log, replace(around, completed=completed), first, result, patterns)
        if waiting:
            diagnosis = replace(diagnosis, notes=(wording.WAITING, *diagnosis.notes))
        return Answer(diagnosis, result.kept, result.parameter, followed)

    def _borne_out(
        self, around: Circumstances, search: Search, rng: np.random.Generator, earlier: Sequence[Estimated]
    ) -> tuple[Round, Round, list[Estimated], Corrected]:
        """Return the first and the last round of a search, its causes, and the correction by them.

        Where unseen days bear none of them out, the search is made again without those that they refuse: what explains
        most may stand in for the true cause, by a law that bends less.
        """
        days, knowledge, rules, longitude = around.completed.days, around.knowledge, around.rules, search.site.longitude
        first: Round | None = None
        for _ in range(rules.most_causes):
            self.progress("searching for causes")
            begun, last, found = search.run(rng, earlier)
            first = first or begun
            unseen = hidden_by_missing_weather(first.design.line)
            found = [replace(one, confounded=(*one.confounded, *unseen)) for one in found]
            if found and unseen:
                # What a pattern says beside them, a cause whose weather is not logged says as well.
                last = replace(last, patterns=())
            self.progress("correcting the model")
            result = correct(days, knowledge, found, last.patterns, longitude, rules)
            if result.kept or not result.unproven or around.new_crop:
                break
            search = replace(search, without=search.without | result.unproven)
        assert first is not None
        return first, last, found, result

    def _search(self, around: Circumstances, site: Site) -> Search:
        """Return the search that the circumstances of a log leave."""
        is_later = self.history is not None
        return search_of(
            around.completed.days, site, around.knowledge, self.without | around.not_asked, around.rules,
            self.null_gains, is_later=is_later, by_days=around.by_days,
        )  # fmt: skip

    def _diagnosis(
        self, log: Log, around: Circumstances, first: Round, result: Corrected, patterns: Sequence[Hypothesis]
    ) -> Diagnosis:
        """Return what was told of a log, with the errors on unseen days and the model that comes of it.

        Args:
            log: that was asked.
            around: its circumstances.
            first: round of the search.
            result: of the correction.
            patterns: what no cause explains.
        """
        model, rules, days, site = self.model, around.rules, around.completed.days, log.known_site
        verdict, findings = _verdict(around.completed, result, patterns, rules)
        stages = stages_of(result, around.completed, around.logged)
        self.progress("predicting unseen days")
        runs = runs_of(stages)
        errors = errors_of(runs)
        start, end = log.telemetry.time[0], log.telemetry.time[-1]
        known = model.crop or built_in_crop()
        crop = corrected_crop(log, days.record, around.knowledge, result.stages["corrected"], findings, known)
        corrected = corrected_model(model, result, findings, errors, (start, end), crop)
        possible = {name for one in findings for name in one.confounded}
        not_asked = {*first.design.untestable, *around.of_crop}
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
            untestable=tuple(name for name in EFFECTS if name in not_asked and name not in possible),
            missing=around.logged.record.missing,
            notes=around.notes,
            evidence=Evidence(
                days, around.knowledge, first, {name: stage for name, (stage, _) in stages.items()}, runs["24_h"]
            ),
            log=log,
        ).settled()

    def _since(
        self,
        change: ParameterChange,
        begin: np.datetime64,
        log: Log,
        rivals: Sequence[ActiveTerm] = (),
    ) -> Answer | None:
        """Return what the days since a parameter has changed tell; None where these alone do not bear it out.

        One set of parameters is none for a log of two greenhouses: the one that is there now counts.

        Args:
            change: by the whole log.
            begin: of it.
            log: whole.
            rivals: faults of sensors that the whole log tells as well: these days tell which of both it is.
        """
        later = log.select(begin)
        if later.days < self.rules.least_days:
            return None
        # A sensor that drifts has drifted since the whole log began.
        rivals = [one if one.onset is not None else replace(one, onset=log.telemetry.time[0]) for one in rivals]
        # Without the days before there is less to see: what leads in the whole log, unseen days alone must bear out.
        asked = replace(change, onset=None, leads=change.leads and not rivals)
        told = self.answer(later, asked if rivals or change.leads else None, rivals)
        diagnosis = told.diagnosis
        findings = tuple(begun(one, change) if is_same(one, change) else one for one in diagnosis.findings)
        if findings == diagnosis.findings:
            return None
        return replace(told, diagnosis=replace(diagnosis, findings=findings, notes=(*diagnosis.notes, wording.SINCE)))


def remembering(model: FittedModel, change: ParameterChange | None, rules: DecisionRules) -> FittedModel:
    """Return a model whose history knows that a parameter has changed, so that it is no news in the next log."""
    if change is None or model.history is None:
        return model
    share = change.share
    deviation = 0.5 * (share.high - share.low) / normal_quantile(rules)
    return replace(model, history=history.followed(model.history, members(change.parameter), share.value, deviation))


def _verdict(
    completed: Completed, result: Corrected, patterns: Sequence[Hypothesis], rules: DecisionRules
) -> tuple[Verdict, tuple[Finding, ...]]:
    findings = (
        *(wording.actuator(one) for one in completed.found),
        # The surest first: where two may do for one cause, the lesser of them can be the larger.
        *(wording.finding(one) for one in sorted(result.kept, key=lambda one: -one.certainty)),
        *(() if result.parameter is None else (wording.parameter(result.parameter),)),
    )
    verdict: Verdict = "ambiguous" if any(len(one.confounded) > 1 for one in findings) else "named"
    if patterns:
        # A process that was there all along may be a part of it.
        apart = any(EFFECTS[one.effect].kind == "sensor" or one.onset is not None for one in result.kept)
        verdict = verdict if apart or completed.found else "unexplained"
        return verdict, (*findings, wording.discrepancy(patterns, rules))
    return verdict if findings else "nothing", findings


def _data_fault(log: Log, model: FittedModel) -> Diagnosis:
    time, notes = log.telemetry.time, tuple(map(str, log.faults))
    return Diagnosis(
        log.known_site.name, "data_fault", time[0], time[-1], 0, 0, (), {}, log.screened, model, model,
        notes=notes, log=log,
    )  # fmt: skip
