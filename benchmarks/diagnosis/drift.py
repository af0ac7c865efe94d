"""Learn how greenhouses change from a calibration to a later log, and what a change must gain, from nurseries.

In every nursery (one a season) each greenhouse is calibrated on eight weeks, and then logged three times more, with
nothing missing but a little drift, once with wrong noise or a cleaned cover. The rates that gains are judged under are
learned from the nurseries of the other seasons. No case of a benchmark has these seeds.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from igrow.trainer.diagnosis import change, drift, history, linear, parameter_change, search, sharing
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.drift import Drift, Pair
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.fit.gaussian import Gaussian

COMMAND = "python -m benchmarks.diagnosis drift"
SEEDS = {"spring": 110_000, "autumn": 120_000, "winter": 130_000}
GREENHOUSES, DAYS = 8, 28
BETWEEN = 42.0
"""Days from the middle of a calibration to that of a later log."""
FALSE_CLAIMS = 0.06
"""Share of logs with nothing missing that the search may give a name, each greenhouse judged by the gains of the others
alone. By those of all it gives fewer, and unseen days refuse some of these: `same` counts what is left."""
LEAST, MOST = 8, 30
"""Bounds that are tried."""


@dataclass(frozen=True)
class NullLog:
    """A later log in which nothing is missing."""

    season: str
    greenhouse: str
    group: str
    design: Design
    pair: Pair


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


def null_log(job: tuple[Reference, Case, Telemetry]) -> NullLog:
    """Lay out a log about its calibration."""
    reference, case, telemetry = job
    known, site = reference.model.history, reference.greenhouse.site
    assert known is not None
    days = log_days(prepare_log(telemetry, site), reference.model)
    plain = history.laid_out(days, site, known, (), DEFAULT)
    design = history.expected(known, plain, history.expected_misfit(known, plain))
    # What the search needs is in the products; the columns themselves would fill the memory.
    light = replace(design, values=design.values[:, :0], grams=_single(design))
    pair = sharing.pair(known, plain, light, BETWEEN)
    return NullLog(reference.greenhouse.site.name.split("-")[0], site.name, case.group, light, pair)


def _single(design: Design) -> linear.DailyGrams:
    return linear.DailyGrams(design.grams.products.astype(np.float32), design.grams.fit)


def gains_under(log: NullLog, learned: Drift) -> dict[str, float]:
    """Return the proven gain of every effect in a log under a drift, the one that would be named first."""
    return _gains(_under(log, learned), search.score_candidates)


def parameter_gains(log: NullLog) -> dict[str, float]:
    """Return the same of every parameter where all else changes by physics alone."""
    return _gains(parameter_change.joined(_under(log, Drift({}, BETWEEN))), parameter_change.score)


def _gains(design: Design, score: Callable[..., list[search.Hypothesis]]) -> dict[str, float]:
    fitted = linear.fit(design.grams, design.null_model())
    scored = score(design, fitted, search.onset_days(design), np.random.default_rng(0))
    ranked = sorted(scored, key=lambda one: -change.net_gain(design, one))
    return {one.key: change.proven_gain(design, one) for one in ranked}


def _under(log: NullLog, learned: Drift) -> Design:
    design, pair = log.design, log.pair
    assert design.history is not None
    keys = design.history.amplitudes.names
    rates = [learned.rate(key, rate, BETWEEN) for key, rate in zip(pair.keys, pair.expected.tolist(), strict=True)]
    covariance = pair.known + np.diag((pair.unit * np.array(rates)) ** 2)
    now = replace(design.history, amplitudes=Gaussian(keys, np.zeros(len(keys)), covariance), drift=learned)
    return replace(design, history=now)


def largest(gains: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the largest gain of every effect."""
    names = sorted({name for one in gains for name in one})
    return {name: float(f"{max(0.0, *(one.get(name, 0.0) for one in gains)):.3g}") for name in names}


def false_claims(
    logs: Sequence[NullLog], gains: Sequence[dict[str, float]], least: float
) -> list[tuple[str, str, str]]:
    """Return (greenhouse, group, effect) of every log with a name, each judged by the gains of other greenhouses."""
    claims = []
    for log, own in zip(logs, gains, strict=True):
        rest = [one for other, one in zip(logs, gains, strict=True) if other.greenhouse != log.greenhouse]
        bound = Drift({}, BETWEEN, largest(rest), least)
        named = next(iter(own), "")
        if named and own[named] >= bound.needed_gain(named, DEFAULT):
            claims.append((log.greenhouse, log.group, named))
    return claims


def false_parameters(logs: Sequence[NullLog], gains: Sequence[dict[str, float]]) -> list[str]:
    """Return the parameters that gain what they must, each greenhouse judged by the gains of the others."""
    claims = []
    for log, own in zip(logs, gains, strict=True):
        rest = largest([one for other, one in zip(logs, gains, strict=True) if other.greenhouse != log.greenhouse])
        needed = {
            key: max(DEFAULT.least_parameter_gain, DEFAULT.parameter_over_null * rest.get(key, 0.0)) for key in own
        }
        claims += [f"{log.greenhouse} {key}" for key, gain in own.items() if gain >= needed[key]]
    return claims


def unchanged(jobs: Jobs) -> list[tuple[Reference, Case, Telemetry]]:
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


def learn(logs: Sequence[NullLog]) -> Drift:
    """Return the rates of logs; wrong noise teaches none."""
    return drift.learn([one.pair for one in logs if one.group != "noise"], BETWEEN)


def main(processes: int) -> int:
    """Write the drift into the package."""
    logs: list[NullLog] = []
    with Jobs("diagnosis drift", processes) as jobs:
        for one in jobs.each(null_log, unchanged(jobs)):
            logs.append(one)
            print(f"{len(logs)} logs", file=sys.stderr, flush=True)
    gains: list[dict[str, float]] = []
    for season in SEEDS:
        learned = learn([one for one in logs if one.season != season])
        gains += [gains_under(one, learned) for one in logs if one.season == season]
        print(f"{season}: judged under the rates of the other seasons", file=sys.stderr, flush=True)
    print(f"{len(logs)} logs with nothing missing; false claims, each greenhouse by the gains of the others:")
    least = float(MOST)
    for bound in range(MOST, LEAST - 1, -1):
        claims = false_claims(logs, gains, bound)
        if len(claims) <= FALSE_CLAIMS * len(logs):
            least = float(bound)
        if bound <= 2 * LEAST:
            print(f"  bound {bound}: {len(claims)} {claims}")
    moved = [parameter_gains(one) for one in logs]
    print(f"parameters that would be named by the gains of other greenhouses: {false_parameters(logs, moved)}")
    found = learn(logs)
    for key, rate in sorted(found.rates.items(), key=lambda item: -item[1])[:20]:
        print(f"  {key:40} {rate:.3f}")
    done = replace(
        found, null_gains=largest(gains) | largest(moved), least_gain=least, provenance=provenance(COMMAND, dict(SEEDS))
    )
    path = Path(str(files("igrow.trainer.diagnosis"))) / drift.FILE
    drift.write_drift(path, done)
    print(f"least gain {least:g}; wrote {path}")
    return 0
