"""From a log to the verdict: screen, recalibrate, search, test, date, judge on unseen days."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from igrow_core.effects import EFFECTS
from igrow_core.errors import IgrowError
from igrow_core.simulator.hybrid.record import Record
from igrow_core.site import Site
from igrow_core.telemetry import Telemetry
from trainer.diagnosis import freefit, freerun, problem, runner, screening, selection, structure, wording
from trainer.diagnosis.activation import ActiveTerm, activate
from trainer.diagnosis.adequacy import Adequacy, judge
from trainer.diagnosis.deployed import Deployed
from trainer.diagnosis.estimate import Estimated, estimate
from trainer.diagnosis.freerun import Runs
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.result import HORIZONS, Diagnosis, Finding, Verdict
from trainer.diagnosis.selection import Selected
from trainer.diagnosis.split import Split, split_days

LEAST_DAYS = 7
SMALLEST_GAIN = 12.0
"""Log-likelihood that a term must add on the fit days."""
LARGEST_P_VALUE = 0.005
"""Of the day-block max-T test, the price of searching paid."""
SMALLEST_ENR = 0.15
"""A cause that moves a 24 h forecast by less is not worth a name."""


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
class Evidence:
    """What the report plots."""

    record: Record
    split: Split
    problem: Problem
    chain: tuple[Selected, ...]
    runs: dict[str, Runs]
    """24 h free runs on held-out days by stage."""
    corrected: CorrectedModel


def diagnose(
    telemetry: Telemetry,
    site: Site,
    deployed: Deployed,
    *,
    without: Collection[str] = (),
    seed: int = 0,
) -> tuple[Diagnosis, Evidence | None]:
    """Return the diagnosis of a log, and what supports it (None for a data fault).

    Args:
        telemetry: of the site, 5 min to hourly; gaps and missing columns are allowed.
        site: its description.
        deployed: the model in force.
        without: effects that are not to be considered.
        seed: of the random flips and bootstraps.

    Raises:
        IgrowError: the log is shorter than a week, or lacks outdoor or air temperature.
    """
    for name in screening.NEEDED:
        if name not in telemetry or not np.isfinite(telemetry[name]).any():
            raise IgrowError(f"the log has no {name}: a diagnosis needs it")
    span = (telemetry.time[-1] - telemetry.time[0]).astype("timedelta64[s]").astype(float) / 86_400.0
    if span < LEAST_DAYS:
        raise IgrowError(f"the log spans {span:.1f} days: a diagnosis needs at least {LEAST_DAYS}")
    for name in without:
        if name not in EFFECTS:
            raise IgrowError(f"no effect is called {name!r}; there are {', '.join(EFFECTS)}")
    rng = np.random.default_rng(seed)
    screened = screening.screen(telemetry)
    if screened.faults:
        return _data_fault(site, telemetry, screened), None
    record, _ = runner.open_record(screened.telemetry, site, deployed)
    split = split_days(record, site.longitude)
    active = activate(record, deployed.effects)
    prepared = problem.prepare(record, split, deployed.prior, active, site.longitude, deployed.known_misfit, without)
    null = structure.null_model(prepared)
    chain = selection.forward(prepared, null, rng, smallest_gain=SMALLEST_GAIN, largest_p_value=LARGEST_P_VALUE)
    judged = judge(prepared, chain, rng)
    estimated = estimate(prepared, judged.selected, rng)

    runs = prepared.line.runs
    knowledge = deployed.free_run_prior
    parameters, deviation = freefit.fit(record, runs, split, knowledge, active)
    stages: dict[str, tuple[dict[str, float], tuple[ActiveTerm, ...]]] = {
        "deployed": (dict(deployed.parameters), deployed.effects),
        "recalibrated": (parameters, deployed.effects),
        "corrected": (parameters, deployed.effects),
    }
    kept: list[Estimated] = []
    for one in estimated:
        terms = (*deployed.effects, *(other.term for other in kept), one.term)
        fitted, spread = freefit.fit(record, runs, split, knowledge, activate(record, terms), stages["corrected"][0])
        before, after = _stage_runs(record, split, stages["corrected"]), _stage_runs(record, split, (fitted, terms))
        plain = _stage_runs(record, split, (fitted, stages["corrected"][1]))
        if before is None or after is None or plain is None:
            kept.append(one)
            continue
        doubt = freerun.improves(freerun.skill_by_day(before, after), rng)
        size = freerun.effect_to_noise(plain, after)
        if doubt < 0.5 and size >= SMALLEST_ENR:
            kept.append(replace(one, effect_to_noise=size, doubt=doubt))
            stages["corrected"] = (fitted, terms)
            deviation = spread
    errors = _errors(record, split, stages)
    verdict, findings = _verdict(prepared, judged, kept)
    model = CorrectedModel(
        stages["corrected"][0],
        deviation,
        stages["corrected"][1],
        {},
        dict(deployed.known_misfit),
    )
    diagnosis = Diagnosis(
        site.name,
        verdict,
        telemetry.time[0],
        telemetry.time[-1],
        int(split.fit.sum()),
        int((~split.fit).sum()),
        findings,
        errors,
        screened.screened,
        prepared.untestable,
        record.unknown,
    )
    shown = {name: one for name, stage in stages.items() if (one := _stage_runs(record, split, stage)) is not None}
    return diagnosis, Evidence(record, split, prepared, tuple(chain), shown, model)


def _verdict(prepared: Problem, judged: Adequacy, kept: Sequence[Estimated]) -> tuple[Verdict, tuple[Finding, ...]]:
    findings = tuple(wording.finding(one) for one in kept)
    if judged.remainder is not None:
        return "unexplained", (*findings, wording.remainder(prepared, judged))
    if not findings:
        return "nothing", ()
    return ("ambiguous" if any(len(one.rivals) > 1 for one in findings) else "named"), findings


def _stage_runs(record: Record, split: Split, stage: tuple[dict[str, float], tuple[ActiveTerm, ...]]) -> Runs | None:
    parameters, terms = stage
    return freerun.run(record, split, parameters, activate(record, terms), "24_h")


def _errors(
    record: Record, split: Split, stages: dict[str, tuple[dict[str, float], tuple[ActiveTerm, ...]]]
) -> dict[str, dict[str, dict[str, float]]]:
    """Return the mean absolute errors on held-out days: quantity -> horizon -> stage."""
    table: dict[str, dict[str, dict[str, float]]] = {}
    for horizon in HORIZONS:
        for stage, (parameters, terms) in stages.items():
            runs = freerun.run(record, split, parameters, activate(record, terms), horizon)
            if runs is None:
                continue
            for name, error in runs.errors.items():
                if np.isfinite(error).any():
                    table.setdefault(name, {}).setdefault(horizon, {})[stage] = float(np.nanmean(np.abs(error)))
    return table


def _data_fault(site: Site, telemetry: Telemetry, screened: screening.Screening) -> Diagnosis:
    return Diagnosis(
        site.name, "data_fault", telemetry.time[0], telemetry.time[-1], 0, 0, (), {}, screened.screened,
        notes=screened.faults,
    )  # fmt: skip
