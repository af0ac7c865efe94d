"""From a log to the verdict: screen, recalibrate, search, test, date, judge on unseen days."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.data.splits import DaySplit as Split
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import (
    freefit,
    freerun,
    likelihood,
    problem,
    refine,
    resolution,
    selection,
    structure,
    usual,
    wording,
)
from igrow.trainer.diagnosis.activation import ActiveTerm, activate
from igrow.trainer.diagnosis.adequacy import Adequacy, judge
from igrow.trainer.diagnosis.deployed import Deployed
from igrow.trainer.diagnosis.drivers import Pattern, pattern_fluxes
from igrow.trainer.diagnosis.estimate import Estimated, estimate, with_refined, within_bounds
from igrow.trainer.diagnosis.freerun import Runs
from igrow.trainer.diagnosis.linearisation import DivergenceError, Floats
from igrow.trainer.diagnosis.prior import Prior
from igrow.trainer.diagnosis.problem import Problem
from igrow.trainer.diagnosis.result import HORIZONS, Diagnosis, Finding, Interval, Verdict
from igrow.trainer.diagnosis.selection import Selected

MOST_CAUSES = 3
SMALLEST_ENR = 0.15
"""A cause that moves a 24 h forecast by less is not worth a name."""
SMALLEST_SKILL = 0.01
"""Share of the squared error of plain free runs on unseen days that a cause must remove, mean over quantities: little,
since a recalibration can hide much of a cause."""
CLEAR_SKILL = 0.03
"""A cause that removes so much needs no other proof on unseen days."""
LARGEST_DOUBT = 0.5
"""Else the largest bootstrap probability that unseen days are not likelier with it."""
FURTHER_SKILL, FURTHER_DOUBT, FURTHER_GAIN = CLEAR_SKILL, 0.2, 0.2
"""What a second or third cause must show: skill, doubt, and a share of the gain of those before it. The first, bent
otherwise than the catalogue has it, leaves traces that look like small others."""
REGIMES = (("day", "night"), ("calm", "windy"), ("vents shut", "vents open"), ("first half", "second half"))
REGIME_SHARE = 0.25
"""A cause's size in one regime must be at least so much of that in the other: else it is another cause's trace."""
LARGEST_REMAINDER = 5.0
"""Bound of the remainder's amplitudes, in units of a pattern."""
NOT_CALIBRATED = (
    "What the model misses of this greenhouse when all is well is not known, so only large causes can be told from a "
    "greenhouse that is another: calibrate it on weeks that are known to be good (igrow-trainer calibrate)."
)


@dataclass(frozen=True)
class CorrectedModel:
    """What the loop ships: parameters, effects in force, and (if it helped) fluxes on outside drivers."""

    parameters: dict[str, float]
    standard_deviation: dict[str, float]
    effects: tuple[ActiveTerm, ...]
    remainder: dict[str, float] = field(default_factory=dict)
    """Amplitude by key of a pattern (`problem.pattern_key`)."""
    known_misfit: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Stage:
    """One model of the tables: deployed, recalibrated, corrected."""

    parameters: dict[str, float]
    deviation: dict[str, float]
    terms: tuple[ActiveTerm, ...]
    remainder: dict[str, float] = field(default_factory=dict)
    added: dict[str, Floats] = field(default_factory=dict)
    """The remainder's fluxes by channel, (n,)."""

    def runs(self, record: Record, split: Split, horizon: str = "24_h") -> Runs | None:
        """Run freely on held-out days."""
        effects = activate(record, self.terms)
        return freerun.run(record, split, self.parameters, effects, horizon, added=self.added)


@dataclass(frozen=True)
class Evidence:
    """What the report plots."""

    record: Record
    split: Split
    first: Selected
    """What the search selected first."""
    weighed: tuple[Estimated, ...]
    """Every selected term with its size and skill on unseen days, kept or not."""
    runs: dict[str, Runs]
    """24 h free runs on held-out days by stage."""
    corrected: CorrectedModel
    knowledge: Prior
    """Under which the free runs were fitted."""


def diagnose(
    log: Log | Telemetry,
    site: Site,
    deployed: Deployed,
    *,
    without: Collection[str] = (),
    seed: int = 0,
) -> tuple[Diagnosis, Evidence | None]:
    """Return the diagnosis of a log, and what supports it (None for a data fault).

    Args:
        log: of the site, a row every minute to every hour; gaps and missing columns are allowed.
        site: its description.
        deployed: the model in force.
        without: effects that are not to be considered.
        seed: of the random flips and bootstraps.

    Raises:
        IgrowError: the log is shorter than a week, or lacks outdoor or air temperature.
    """
    log = prepare_log(log, site) if isinstance(log, Telemetry) else replace(log, site=site)
    if log.faults:
        return _data_fault(log), None
    log.require("a diagnosis")
    for name in without:
        if name not in EFFECTS:
            raise IgrowError(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
    rng = np.random.default_rng(seed)
    record = log.record(log.best_shift(deployed.parameters) if deployed.shift is None else deployed.shift)
    split = split_days(record, site.longitude)
    search = _search(record, split, site, deployed, frozenset(without), rng)
    prepared = search.problem

    stages, kept, weighed = _correct(record, split, site, deployed, search)
    errors = _errors(record, split, stages)
    verdict, findings = _verdict(search, kept)
    last = stages["corrected"]
    model = CorrectedModel(last.parameters, last.deviation, last.terms, last.remainder, dict(deployed.known_misfit))
    diagnosis = Diagnosis(
        site.name,
        verdict,
        log.telemetry.time[0],
        log.telemetry.time[-1],
        int(split.fit.sum()),
        int((~split.fit).sum()),
        findings,
        errors,
        log.screened,
        prepared.untestable,
        record.unknown,
        () if deployed.known_misfit else (NOT_CALIBRATED,),
    )
    shown = {name: day for name, stage in stages.items() if (day := stage.runs(record, split)) is not None}
    return diagnosis, Evidence(record, split, search.first, tuple(weighed), shown, model, deployed.free_run_prior)


@dataclass(frozen=True)
class _Search:
    """What a search found."""

    problem: Problem
    """Of the deployed model."""
    first: Selected
    """What its first round selected."""
    found: tuple[Estimated, ...]
    judged: Adequacy
    """Of the last round."""


def _search(
    record: Record,
    split: Split,
    site: Site,
    deployed: Deployed,
    without: frozenset[str],
    rng: np.random.Generator,
) -> _Search:
    """Look for one cause after the other, each in a model that has those before it.

    A large effect moves the model far from where the search linearised it; further causes and what remains can
    be told only after it has been put in.
    """

    known = usual.installed()
    directions = known.directions if deployed.known_misfit else known.elsewhere

    def prepared(terms: Sequence[ActiveTerm], interval: float) -> Problem:
        hours = interval == problem.HOUR
        return problem.prepare(
            record, split, deployed.prior, activate(record, terms), site.longitude, deployed.known_misfit,
            directions if hours else (), without, interval, known.sizes(split.days) if hours else {},
        )  # fmt: skip

    problem_now = prepared(deployed.effects, problem.HOUR)
    if record.step < problem.HOUR:
        rows = prepared(deployed.effects, record.step)
        if resolution.disagreement(problem_now, rows) <= resolution.LARGEST_DISAGREEMENT:
            problem_now = rows
    first: tuple[Problem, Selected] | None = None
    found: list[Estimated] = []
    while True:
        none = likelihood.profile(problem_now, structure.null_model(problem_now))
        more = len(found) < MOST_CAUSES
        cause = selection.best_cause(problem_now, none, rng) if more else None
        judged = judge(problem_now, none, cause, sum(one.gain for one in found), rng)
        first = first or (problem_now, judged.selected)
        new = estimate(judged.selected, rng)
        if new:
            new = _refined(judged.selected, [*found, *new], deployed)
        if len(new) <= len(found):
            return _Search(*first, tuple(found), judged)
        try:
            problem_now = prepared((*deployed.effects, *(one.term for one in new)), problem_now.interval)
        except DivergenceError:
            # No cause: the log itself stayed within all bounds.
            return _Search(*first, tuple(found), judged)
        found = new


def _refined(selected: Selected, estimated: list[Estimated], deployed: Deployed) -> list[Estimated]:
    """Return all terms refitted together, or none where one turns round or a further one adds nothing of its own.

    A further one that only mops up what is left runs to its bound; one that is an alias of another (two ways for CO2 to
    leak in) leaves neither with a size.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            found = refine.refine(selected.problem, selected.named, [one.term for one in estimated], deployed.effects)
    except (ValueError, np.linalg.LinAlgError, DivergenceError):
        found = []
    if not found or not all(np.isfinite(one.term.amplitude) and np.isfinite(one.deviation) for one in found):
        # Undamped steps can run away from a poor start; the terms then stay as the search found them.
        return [within_bounds(one) for one in estimated]
    better = [with_refined(one, two) for one, two in zip(estimated, found, strict=True)]
    stands = all(one.term.amplitude != 0.0 for one in better) and _inside(better[1:])
    return better if stands and (len(found) == 1 or refine.told_apart(found)) else []


def _inside(terms: Sequence[Estimated]) -> bool:
    """Tell whether terms lie inside their bounds."""
    bounds = ((one.term.amplitude, EFFECTS[one.effect].amplitude) for one in terms)
    return all(amplitude < bound.high and (bound.low == 0.0 or amplitude > bound.low) for amplitude, bound in bounds)


def _correct(
    record: Record, split: Split, site: Site, deployed: Deployed, search: _Search
) -> tuple[dict[str, Stage], list[Estimated], list[Estimated]]:
    """Fit the model with each term in turn, and keep those that stand on unseen days.

    Returns the stages by name, the terms that were kept, and all of them with their size and skill.
    """
    runs, knowledge = search.problem.line.runs, deployed.free_run_prior
    parameters, deviation = freefit.fit(record, runs, split, knowledge, activate(record, deployed.effects))
    stages = {
        "deployed": Stage(dict(deployed.parameters), dict(deployed.standard_deviation), deployed.effects),
        "recalibrated": Stage(parameters, deviation, deployed.effects),
    }
    current = stages["recalibrated"]
    kept: list[Estimated] = []
    weighed: list[Estimated] = []
    for one in search.found:
        terms = (*current.terms, one.term)
        # Where the effect takes over what recalibration had put into the parameters, the fit starts there.
        begin = {name: value + one.shift.get(name, 0.0) for name, value in current.parameters.items()}
        try:
            trial = Stage(*freefit.fit(record, runs, split, knowledge, activate(record, terms), begin), terms)
        except DivergenceError:
            weighed.append(one)
            continue
        before, after = current.runs(record, split), trial.runs(record, split)
        plain = replace(trial, terms=current.terms).runs(record, split)
        if before is not None and after is not None and plain is not None:
            one = replace(  # noqa: PLW2901
                one,
                effect_to_noise=freerun.effect_to_noise(plain, after),
                skill=float(freerun.skill_by_day(before, after).mean()),
            )
        weighed.append(one)
        if _stands(one, kept):
            kept.append(one)
            current = trial
    if search.judged.remainder:
        current = _with_remainder(record, split, site, search, knowledge, current)
    return {**stages, "corrected": current}, kept, weighed


def _stands(one: Estimated, kept: Sequence[Estimated]) -> bool:
    """Tell whether a term is large enough, and holds on unseen days; one beside others must do more."""
    if one.effect_to_noise < SMALLEST_ENR or not same_in_all_regimes(one.regimes):
        return False
    if not kept:
        return one.skill >= CLEAR_SKILL or (one.skill >= SMALLEST_SKILL and one.doubt <= LARGEST_DOUBT)
    return (
        one.skill >= FURTHER_SKILL
        and one.doubt <= FURTHER_DOUBT
        and one.gain >= FURTHER_GAIN * sum(other.gain for other in kept)
    )


def same_in_all_regimes(regimes: Mapping[str, Interval]) -> bool:
    """Tell whether a term's size is about the same by day and by night, in calm and in wind, and so on.

    A regime in which the effect hardly shows has no size of its own.
    """
    pairs = ([regimes[name].value for name in pair] for pair in REGIMES if all(name in regimes for name in pair))
    return all(a * b > 0.0 and min(a / b, b / a) >= REGIME_SHARE for a, b in pairs)


def _with_remainder(
    record: Record, split: Split, site: Site, search: _Search, knowledge: Prior, current: Stage
) -> Stage:
    """Return the stage with a bounded remainder on outside drivers, if that helps on unseen days."""
    assert search.judged.remainder is not None
    amplitudes = {
        (one.cause.channel, one.cause.when): float(np.clip(one.amplitude, -LARGEST_REMAINDER, LARGEST_REMAINDER))
        for one in search.judged.remainder
        if isinstance(one.cause, Pattern)
    }
    added = pattern_fluxes(record, site.longitude, amplitudes)
    effects = activate(record, current.terms)
    try:
        fitted = freefit.fit(record, search.problem.line.runs, split, knowledge, effects, current.parameters, added)
    except DivergenceError:
        return current
    remainder = {f"{channel}:{when}": amplitude for (channel, when), amplitude in amplitudes.items()}
    trial = Stage(*fitted, current.terms, remainder, added)
    before, after = current.runs(record, split), trial.runs(record, split)
    if before is None or after is None or freerun.skill_by_day(before, after).mean() <= 0.0:
        return current
    return trial


def _verdict(search: _Search, kept: Sequence[Estimated]) -> tuple[Verdict, tuple[Finding, ...]]:
    findings = tuple(wording.finding(one) for one in sorted(kept, key=lambda one: -one.effect_to_noise))
    if search.judged.remainder is not None:
        return "unexplained", (*findings, wording.remainder(search.judged))
    if not findings:
        return "nothing", ()
    return ("ambiguous" if any(len(one.rivals) > 1 for one in findings) else "named"), findings


def _errors(record: Record, split: Split, stages: Mapping[str, Stage]) -> dict[str, dict[str, dict[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon in HORIZONS:
        for name, stage in stages.items():
            runs = stage.runs(record, split, horizon)
            for quantity, error in runs.errors.items() if runs is not None else ():
                if np.isfinite(error).any():
                    table.setdefault(quantity, {}).setdefault(horizon, {})[name] = float(np.nanmean(np.abs(error)))
    return table


def _data_fault(log: Log) -> Diagnosis:
    time = log.telemetry.time
    return Diagnosis(
        log.known_site.name, "data_fault", time[0], time[-1], 0, 0, (), {}, log.screened,
        notes=tuple(map(str, log.faults)),
    )  # fmt: skip
