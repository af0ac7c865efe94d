"""What a diagnosis got right in a case whose truth is known."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.cases import CHANGES, Case, hidden
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.naming import is_named
from igrow.core import sun
from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse.hidden import EffectBank, HiddenEffect
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.site import Site
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.answer.evidence import Evidence, errors_with
from igrow.trainer.diagnosis.answer.result import Finding
from igrow.trainer.diagnosis.design import linear, sensitivity
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.design.sensitivity import Linearisation
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.search import change

NOISE = {"air_temperature": 0.5, "air_humidity": 2.0, "air_co2": 35.0}
"""Scales under which errors of different quantities are added."""


@dataclass(frozen=True)
class Outcome:
    """One case, judged."""

    case: Case
    verdict: str
    found: tuple[str, ...]
    confounded: tuple[tuple[str, ...], ...]
    relative_size: float | None
    """Estimate over truth of the first finding, where it is right: of the amplitude, which is not the same where the
    truth has another form, or another value of the nonlinear parameter beside it."""
    relative_flux: float | None
    """The same of what it adds, root mean square along the log."""
    covered: bool | None
    """The truth lies in its 90 % interval."""
    half_width: float | None
    """Half of that interval over the truth."""
    onset_error: float | None
    """Days."""
    deployed: float
    """24 h error on unseen days by the model in force, quantities scaled and added."""
    recalibrated: float
    corrected: float
    perfect: float
    """With the true cause in the model, in the catalogue's form."""
    expected_gain: float | None
    """Log-likelihood to be expected of a lone true cause on this log, were the model right but for it: what a search
    can see at best. None for nothing, pairs, beginnings and causes outside the catalogue."""
    known_gain: float | None
    """The same were everything else known."""
    seconds: float


def judged(job: tuple[Case, Telemetry, Reference]) -> Outcome:
    """Diagnose one case as one job."""
    case, telemetry, reference = job
    return judge(case, telemetry, reference)


def judge(case: Case, telemetry: Telemetry, reference: Reference) -> Outcome:
    """Diagnose one case and compare with the truth.

    Args:
        case: the case.
        telemetry: its log.
        reference: its greenhouse, and the model that it is asked by.
    """
    begun = time.perf_counter()
    site = reference.greenhouse.site
    log = prepare_log(telemetry, site)
    diagnosis = diagnose(log, reference.model)
    evidence = diagnosis.evidence
    seconds = time.perf_counter() - begun
    causes = [one for one in diagnosis.findings if one.effect in EFFECTS]
    found = tuple(one.effect for one in diagnosis.findings)
    truth = {one.name: one for one in hidden(case, reference.unit, reference.greenhouse.start)}
    relative, flux, covered, half_width, onset_error = None, None, None, None, None
    for one in causes:
        if one.effect not in truth:
            continue
        true = truth[one.effect]
        amplitude = one.parameters[EFFECTS[one.effect].amplitude.name]
        relative = amplitude.value / float(true.size or 1.0)
        if evidence is not None:
            flux = relative_flux(evidence.first.design.line, one, true)
        covered = amplitude.low <= float(true.size or 0.0) <= amplitude.high
        half_width = 0.5 * (amplitude.high - amplitude.low) / abs(float(true.size or 1.0))
        if true.start is not None:
            onset_error = (
                abs((one.onset.time - true.start) / np.timedelta64(1, "h")) / 24.0 if one.onset is not None else 99.0
            )
        break
    errors = diagnosis.errors
    gains = expected_gains(evidence.first.design, case, truth) if evidence is not None else (None, None)
    return Outcome(
        case,
        diagnosis.verdict,
        found,
        tuple(one.confounded for one in diagnosis.findings if one.kind in {"process", "sensor", "parameter"}),
        relative,
        flux,
        covered,
        half_width,
        onset_error,
        _sum(errors, "deployed"),
        _sum(errors, "recalibrated"),
        _sum(errors, "corrected"),
        _perfect(evidence, truth, site) if evidence is not None and truth else _sum(errors, "recalibrated"),
        *gains,
        seconds,
    )


def relative_flux(line: Linearisation, told: Finding, true: HiddenEffect) -> float:
    """Return what an effect adds as it is told over what it truly adds, root mean squares along a log.

    Both act on the drivers along the measured climate, from the day on which the truth began.

    Args:
        line: of the log.
        told: with all its parameters.
        true: of the same name, with the form that the plant gave it.
    """
    effect = EFFECTS[true.name]
    shape = {one.name: told.parameters[one.name].value for one in effect.shapes}
    amount = told.parameters[effect.amplitude.name].value
    now = unix_seconds(line.record.time)
    begun = np.ones(len(now), dtype=bool) if true.start is None else now >= unix_seconds(true.start)
    bank, memory, channel = EffectBank(np, [true], None, float(now[0])), list[object](), ""
    truly = np.zeros(len(now))
    for row, moment in enumerate(now):
        drivers = {name: values if np.ndim(values) == 0 else values[row] for name, values in line.drivers.items()}
        added = bank.evaluate(drivers, float(moment), line.record.step, memory)
        channel, truly[row] = next(iter(added.items()))
    as_told = amount * sensitivity.unit_fluxes(line, effect, shape)[channel]
    return float(np.sqrt(np.mean(as_told[begun] ** 2) / max(np.mean(truly[begun] ** 2), 1e-300)))


def expected_gains(design: Design, case: Case, truth: Mapping[str, HiddenEffect]) -> tuple[float | None, float | None]:
    """Return half the squared size of a lone true cause over its standard deviation, under the noise that it leaves.

    First with everything else that may be missing integrated out, then as if it were known.
    """
    if len(case.causes) != 1 or case.causes[0] not in EFFECTS or case.onset_day is not None:
        return None, None
    (name,) = case.causes
    typical = {shape.name: shape.typical for shape in EFFECTS[name].shapes}
    own = [
        (sum(abs(candidate.values[key] - value) for key, value in typical.items()), column)
        for column, candidate in zip(design.block("effect").columns, design.candidates, strict=True)
        if candidate.effect == name
    ]
    if not own:
        return None, None
    term = Term(min(own)[1])
    model = design.null_model().with_term(term)
    grams = change.beside(design, model).grams
    size = float(truth[name].size or 0.0)
    free = float(linear.fit(grams, model).deviations[0])
    known = float(grams.products[grams.fit, term.column, term.column].sum())
    if free == 0.0:
        # What a log does not show at all (rain where none fell) nobody sees in it.
        return 0.0, 0.0
    return 0.5 * (size / free) ** 2, 0.5 * size**2 * known


def _sum(errors: Mapping[str, Mapping[str, Mapping[str, float]]], stage: str) -> float:
    return sum(table["24_h"][stage] / NOISE[quantity] for quantity, table in errors.items() if "24_h" in table)


def _perfect(evidence: Evidence, truth: Mapping[str, HiddenEffect], site: Site) -> float:
    """Return the error of the model with the true causes in it, its parameters refitted."""
    terms = []
    added: dict[str, Floats] = {}
    line = evidence.first.design.line
    weekday = 1.0 * sun.weekday(sun.solar_day(evidence.log.record.time, site.longitude))
    line = replace(line, drivers={**line.drivers, "weekday": weekday})
    for name, one in truth.items():
        size = float(one.size or 0.0)
        if name in EFFECTS:
            shape = {shape.name: shape.typical for shape in EFFECTS[name].shapes}
            terms.append(ActiveTerm(name, size, shape, one.start))
            continue
        for channel, flux in sensitivity.unit_fluxes(line, UNCATALOGUED[name], {}).items():
            added[channel] = added.get(channel, 0.0) + size * flux
    return sum(error / NOISE[name] for name, error in errors_with(evidence, terms, added).items())


def is_first(one: Outcome) -> bool:
    """Tell whether the first name is right of a true cause, or of a parameter that has changed."""
    if one.case.changed:
        return bool(one.found) and one.found[0] in CHANGES[one.case.changed][1]
    return any(is_named(cause, one.found[:1]) for cause in one.case.causes)


def has_all(one: Outcome) -> bool:
    """Tell whether every true cause is named."""
    return all(is_named(cause, one.found) for cause in one.case.causes)
