"""Learn what a change must gain: more than effects and parameters do in greenhouses in which nothing has changed.

In every nursery (one a season) each greenhouse is calibrated on eight weeks, and then logged three times more, with
nothing missing but a little drift, once with wrong noise or a cleaned cover. What an effect gained in any of these logs
is what it must exceed. Above that stands what every change must gain: the least with which these logs, each greenhouse
judged by the gains of the others, get a name no more often than they may. No case of a benchmark has these seeds.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later_logs, nursery
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import change, diagnose, history, linear, null_gains, parameter_change, search
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT

COMMAND = "python -m benchmarks.diagnosis null-gains"
SEEDS = {"spring": 110_000, "autumn": 120_000, "winter": 130_000}
GREENHOUSES, DAYS = 8, 28
FALSE_CLAIMS = 0.02
"""Share of logs with nothing missing that may be given a name, each greenhouse judged by the gains of the others."""
LEAST, MOST = 8, 30
"""Bounds that are tried."""
Later = tuple[Reference, Case, Telemetry]
"""A log in which nothing is missing, of a greenhouse that was calibrated before."""


@dataclass(frozen=True)
class Gained:
    """What was gained in such a log, that first which would be named."""

    greenhouse: str
    group: str
    effects: dict[str, float]
    parameters: dict[str, float]


def null_cases(season: str, known: Sequence[Reference]) -> list[list[Case]]:
    """Return three cases of every greenhouse in which nothing is missing."""
    found = []
    for place, one in enumerate(known):
        groups = ("nothing", "nothing", "clean" if place % 2 else "noise")
        found.append([
            Case(
                name=f"{season}-{place}-{number}", group=group, greenhouse=one.greenhouse.site.name,
                seed=SEEDS[season] + 500 + 3 * place + number, heavy_tails=bool(number), wrong_noise=group == "noise",
            )
            for number, group in enumerate(groups)
        ])  # fmt: skip
    return found


def gained(job: Later) -> Gained:
    """Return the gains of every effect and parameter in a log."""
    reference, case, telemetry = job
    known, site = reference.model.history, reference.greenhouse.site
    assert known is not None
    days = log_days(prepare_log(telemetry, site), reference.model)
    plain = history.laid_out(days, site, known, (), DEFAULT)
    design = history.expected(known, plain, history.expected_misfit(known, plain))
    effects = _gains(design, search.score_candidates)
    parameters = _gains(parameter_change.joined(design), parameter_change.score)
    return Gained(site.name, case.group, effects, parameters)


def _gains(design: Design, score: Callable[..., list[search.Hypothesis]]) -> dict[str, float]:
    """Return the proven gain of all, that first which would be named."""
    fitted = linear.fit(design.grams, design.null_model())
    scored = score(design, fitted, search.onset_days(design), np.random.default_rng(0))
    ranked = sorted(scored, key=lambda one: -change.net_gain(design, one))
    return {one.key: change.proven_gain(design, one) for one in ranked}


def largest(gains: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the largest gain of every effect."""
    names = sorted({name for one in gains for name in one})
    return {name: float(f"{max(0.0, *(one.get(name, 0.0) for one in gains)):.3g}") for name in names}


def of_others(found: Sequence[Gained], greenhouse: str, least: float) -> NullGains:
    """Return what greenhouses other than one have gained."""
    others = [one for one in found if one.greenhouse != greenhouse]
    return NullGains(largest([one.effects for one in others]) | largest([one.parameters for one in others]), least)


def is_asked(one: Gained, known: NullGains) -> bool:
    """Tell whether the effect that would be named gains what it must."""
    first = next(iter(one.effects), "")
    return bool(first) and one.effects[first] >= known.needed(first)


def named(job: tuple[Later, NullGains]) -> tuple[str, ...]:
    """Return what a diagnosis names in a log, by the gains of other greenhouses."""
    (reference, _, telemetry), known = job
    told = diagnose(prepare_log(telemetry, reference.greenhouse.site), reference.model, null_gains=known)
    return tuple(one.effect for one in told.findings)


def false_parameters(found: Sequence[Gained]) -> list[str]:
    """Return the parameters that gain what they must, each greenhouse judged by the gains of the others."""
    claims = []
    for one in found:
        known = of_others(found, one.greenhouse, LEAST).largest
        claims += [
            f"{one.greenhouse} {key}"
            for key, gain in one.parameters.items()
            if gain >= max(DEFAULT.least_parameter_gain, DEFAULT.parameter_over_null * known.get(key, 0.0))
        ]
    return claims


def unchanged(jobs: Jobs) -> list[Later]:
    """Simulate the nurseries and calibrate their greenhouses; return the later logs in which nothing is missing."""
    known = {season: nursery(season, GREENHOUSES, first) for season, first in SEEDS.items()}
    weeks = jobs.each(calibration_logs, known.values())
    own = [
        pair
        for one, logs in zip(known.values(), weeks, strict=True)
        for pair in zip(one.greenhouses, logs, strict=True)
    ]
    references: list[Reference] = []
    for one in jobs.each(calibrated, own):
        references.append(one)
        print(f"{len(references)} of {len(own)} calibrated", file=sys.stderr, flush=True)
    by_season = [references[place : place + GREENHOUSES] for place in range(0, len(references), GREENHOUSES)]
    cases = [null_cases(season, greenhouses) for season, greenhouses in zip(SEEDS, by_season, strict=True)]
    later = jobs.each(_later, list(zip(by_season, cases, strict=True)))
    return [
        (one, case, log)
        for greenhouses, asked, logs in zip(by_season, cases, later, strict=True)
        for one, mine, seen in zip(greenhouses, asked, logs, strict=True)
        for case, log in zip(mine, seen, strict=True)
    ]


def _later(job: tuple[Sequence[Reference], Sequence[Sequence[Case]]]) -> list[list[Telemetry]]:
    return later_logs(*job, DAYS)


def least_gain(jobs: Jobs, logs: Sequence[Later], found: Sequence[Gained]) -> float:
    """Return the least that every change must gain, so that few enough of these logs are given a name."""
    for least in range(LEAST, MOST + 1):
        known = [of_others(found, one.greenhouse, float(least)) for one in found]
        asked = [place for place, (one, mine) in enumerate(zip(found, known, strict=True)) if is_asked(one, mine)]
        told = list(jobs.each(named, [(logs[place], known[place]) for place in asked]))
        claims = [(found[place].greenhouse, names) for place, names in zip(asked, told, strict=True) if names]
        print(f"  least gain {least}: {len(asked)} gain what they must; named: {len(claims)} {claims}", flush=True)
        if len(claims) <= FALSE_CLAIMS * len(found):
            return float(least)
    return float(MOST)


def main(processes: int) -> int:
    """Write the gains into the package."""
    found: list[Gained] = []
    with Jobs("diagnosis null-gains", processes) as jobs:
        logs = unchanged(jobs)
        for one in jobs.each(gained, logs):
            found.append(one)
            print(f"{len(found)} of {len(logs)} logs", file=sys.stderr, flush=True)
        print(f"{len(found)} logs with nothing missing; each greenhouse by the gains of the others:")
        least = least_gain(jobs, logs, found)
    print(f"parameters that would be named by the gains of other greenhouses: {false_parameters(found)}")
    gains = largest([one.effects for one in found]) | largest([one.parameters for one in found])
    path = Path(str(files("igrow.trainer.diagnosis"))) / null_gains.FILE
    learned = NullGains(gains, least, provenance(COMMAND, dict(SEEDS)))
    path.write_text(json.dumps(asdict(learned), indent=1) + "\n", encoding="utf-8")
    print(f"least gain {least:g}; wrote {path}")
    return 0
