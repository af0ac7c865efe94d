"""From a log to the verdict, each stage entered once a round.

log, model --> knowledge --> design --> compare --> estimate --> refit --+--> correct --> findings --> Diagnosis
                               ^                                         |
                               +------------ the cause put in -----------+
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.data.log import Log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import freerun, history, sensitivity, wording
from igrow.trainer.diagnosis.change import changed
from igrow.trainer.diagnosis.compare import Round, compare
from igrow.trainer.diagnosis.correction import Corrected, LogDays, correct, corrected_model
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.estimate import Estimated, estimate, with_refitted, within_bounds
from igrow.trainer.diagnosis.evidence import Evidence
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, activate, knowledge_of
from igrow.trainer.diagnosis.nuisance import NuisanceSubspace, learn_discrepancy, read_nuisance
from igrow.trainer.diagnosis.refit import are_identifiable, refit
from igrow.trainer.diagnosis.result import Diagnosis, Finding, Verdict
from igrow.trainer.diagnosis.rules import DEFAULT, HOUR, DecisionRules
from igrow.trainer.diagnosis.structure import disagreement
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.solver import DivergenceError

NOT_CALIBRATED = (
    "What the model misses of this greenhouse when all is well is not known, so only large causes can be told from a "
    "greenhouse that is another: calibrate it on weeks that are known to be good (igrow-trainer calibrate)."
)


def diagnose(
    log: Log,
    model: FittedModel,
    *,
    without: Collection[str] = (),
    seed: int = 0,
    rules: DecisionRules = DEFAULT,
    nuisance: NuisanceSubspace | None = None,
) -> Diagnosis:
    """Return the diagnosis of a log.

    Args:
        log: of the greenhouse; gaps and missing columns are allowed.
        model: in force.
        without: effects that are not to be considered.
        seed: of the random flips and bootstraps.
        rules: every threshold.
        nuisance: what greenhouses show though nothing is missing (None: what came with the trainer).

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
    knowledge = knowledge_of(model, site, rules)
    days = log_days(log, model)
    search = _search(days, site, model, knowledge, frozenset(without), rules, nuisance)
    first, last, found = search.run(np.random.default_rng(seed))
    result = correct(days, knowledge, found, last.patterns, site.longitude, rules)
    verdict, findings = _verdict(result.kept, last, rules)
    errors = _errors(days, result)
    start, end = log.telemetry.time[0], log.telemetry.time[-1]
    runs = {name: day for name, stage in result.stages.items() if (day := days.run(stage)) is not None}
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
        corrected_model(model, result, findings, errors, knowledge.discrepancy, (start, end)),
        first.design.untestable,
        days.record.unknown,
        (NOT_CALIBRATED,) if knowledge.transferred else (),
        Evidence(days, knowledge, first, result.estimates, result.stages, runs),
    )


def discrepancy_of(log: Log, model: FittedModel, rules: DecisionRules = DEFAULT) -> dict[str, float]:
    """Return what a calibrated model misses on its own calibration log, for `FittedModel.discrepancy`.

    Raises:
        DivergenceError: the model runs out of all bounds on it.
    """
    site, days = log.known_site, log_days(log, model)
    knowledge = knowledge_of(model, site, rules)
    design = prepare(days.record, days.split, knowledge.prior, {}, site.longitude, rules, discrepancy={})
    return learn_discrepancy(design)


def history_of(log: Log, model: FittedModel, rules: DecisionRules = DEFAULT) -> Discrepancy:
    """Return the same with its doubt and the colour of its noise, for `FittedModel.history`; raises as above does."""
    record = log_days(log, model).record
    return history.learn(record, log.known_site, model.posterior, rules)


def log_days(log: Log, model: FittedModel) -> LogDays:
    """Return the record of a log as a model reads it, split into days, with its runs."""
    shift = log.best_shift(model.posterior.values) if model.alignment is None else model.alignment
    record = log.record(shift)
    split = split_days(record, log.known_site.longitude)
    return LogDays(record, split, sensitivity.day_runs(record, split.day))


@dataclass(frozen=True)
class _Search:
    """The rounds of a search: one cause after the other, each in a model that has those before it.

    A large effect moves the model far from where the search linearised it; further causes and what remains can
    be told only after it has been put in.
    """

    days: LogDays
    site: Site
    knowledge: Knowledge
    without: frozenset[str]
    rules: DecisionRules
    nuisance: NuisanceSubspace

    def run(self, rng: np.random.Generator) -> tuple[Round, Round, list[Estimated]]:
        """Return the first and the last round, and the causes that were found."""
        design = self.resolved()
        first: Round | None = None
        found: list[Estimated] = []
        while True:
            explained = sum(one.gain for one in found)
            judged = self.judge(design, explained, rng, causes=len(found) < self.rules.most_causes)
            first = first or judged
            new = estimate(judged, rng)
            terms = [] if new is None else self.refitted(judged, [*found, new])
            if not terms:
                return first, judged, found
            try:
                design = self.design([*self.knowledge.terms, *(one.term for one in terms)], design.interval)
            except DivergenceError:
                # No cause: the log itself stayed within all bounds.
                return first, judged, found
            found = terms

    def judge(self, design: Design, explained: float, rng: np.random.Generator, *, causes: bool) -> Round:
        """Return what one round finds."""
        return compare(design, explained, rng, causes=causes)

    def design(self, terms: Sequence[ActiveTerm], interval: float) -> Design:
        """Return the design of a model with terms; what usually differs stands in where its structure does not."""
        hours = interval >= HOUR
        record, split, known = self.days.record, self.days.split, self.knowledge
        return prepare(
            record, split, known.short_prior, activate(record, terms), self.site.longitude, self.rules,
            discrepancy=known.discrepancy,
            directions=self.nuisance.directions(transferred=known.transferred) if hours else (),
            usual_size=self.nuisance.usual_size(split.days, self.rules) if hours else {},
            without=self.without,
            interval=interval,
        )  # fmt: skip

    def resolved(self) -> Design:
        """Return the first design: by time steps where the model's structure is the greenhouse's, else by hours."""
        hours = self.design(self.knowledge.terms, HOUR)
        if self.days.record.step >= HOUR:
            return hours
        steps = self.design(self.knowledge.terms, self.days.record.step)
        return steps if disagreement(hours, steps) <= self.rules.largest_disagreement else hours

    def refitted(self, judged: Round, causes: list[Estimated]) -> list[Estimated]:
        """Return all causes refitted together, or none where one turns round or a further one adds nothing of its own.

        A further one that only mops up what is left runs to its bound; one that is confounded with another (two ways
        for CO2 to leak in) leaves neither with a size.
        """
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                found = refit(judged.design, judged.named, [one.term for one in causes], self.knowledge.terms)
        except (np.linalg.LinAlgError, DivergenceError):
            # A poor start can run away; the causes then stay as the search found them.
            return [within_bounds(one) for one in causes]
        better = [with_refitted(one, two, self.rules) for one, two in zip(causes, found, strict=True)]
        stands = all(one.term.amplitude != 0.0 for one in better) and all(map(_is_inside, better[1:]))
        return better if stands and (len(found) == 1 or are_identifiable(found)) else []


@dataclass(frozen=True)
class _Change(_Search):
    """The same in a greenhouse whose history is known: what has changed in it since."""

    history: Discrepancy
    plain: Design
    """The log without any cause, before any noise."""
    misfit: Floats
    """What the model is expected to miss in this log."""

    def judge(self, design: Design, explained: float, rng: np.random.Generator, *, causes: bool) -> Round:
        """Return what one round finds."""
        return changed(design, explained, rng, causes=causes)

    def design(self, terms: Sequence[ActiveTerm], interval: float) -> Design:
        """Return the design of a model with terms, about the calibrated parameters."""
        plain = _laid_out(self.days, self.site, self.history, terms, self.rules) if terms else self.plain
        return history.expected(self.history, plain, self.misfit, self.without)

    def resolved(self) -> Design:
        """Return the first design: by the steps that the history was learned from."""
        return self.design(self.knowledge.terms, self.days.record.step)


def _search(
    days: LogDays,
    site: Site,
    model: FittedModel,
    knowledge: Knowledge,
    without: frozenset[str],
    rules: DecisionRules,
    nuisance: NuisanceSubspace | None,
) -> _Search:
    """Return the search that fits what is known: of changes where the greenhouse's history applies to the log."""
    common = (days, site, knowledge, without, rules, nuisance or read_nuisance())
    known = model.history
    if not rules.history or known is None or model.calibrated_on != site.name:
        return _Search(*common)
    plain = _laid_out(days, site, known, (), rules)
    if not history.applies(known, plain):
        return _Search(*common)
    return _Change(*common, known, plain, history.expected_misfit(known, plain))


def _laid_out(
    days: LogDays, site: Site, known: Discrepancy, terms: Sequence[ActiveTerm], rules: DecisionRules
) -> Design:
    """Return the design of a log about the parameters of the calibration, before any noise."""
    names = tuple(known.parameters)
    spread = site_prior(site).marginal(names).covariance
    about = Gaussian(names, np.array(list(known.parameters.values())), spread)
    return history.lay_out(days.record, days.split, about, activate(days.record, terms), site.longitude, rules)


def _is_inside(one: Estimated) -> bool:
    """Tell whether a cause lies inside its bounds."""
    bound, amplitude = EFFECTS[one.effect].amplitude, one.term.amplitude
    return amplitude < bound.high and (bound.low == 0.0 or amplitude > bound.low)


def _verdict(kept: Sequence[Estimated], last: Round, rules: DecisionRules) -> tuple[Verdict, tuple[Finding, ...]]:
    findings = tuple(wording.finding(one) for one in sorted(kept, key=lambda one: -one.effect_to_noise))
    if last.patterns:
        return "unexplained", (*findings, wording.discrepancy(last.patterns, rules))
    if not findings:
        return "nothing", ()
    return ("ambiguous" if any(len(one.rivals) > 1 for one in findings) else "named"), findings


def _errors(days: LogDays, result: Corrected) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon in freerun.HORIZONS:
        for name, stage in result.stages.items():
            for quantity, error in freerun.mean_absolute_errors(days.run(stage, horizon)).items():
                table.setdefault(quantity, {}).setdefault(horizon, {})[name] = error
    return table


def _data_fault(log: Log, model: FittedModel) -> Diagnosis:
    time, notes = log.telemetry.time, tuple(map(str, log.faults))
    return Diagnosis(
        log.known_site.name, "data_fault", time[0], time[-1], 0, 0, (), {}, log.screened, model, model, notes=notes
    )
