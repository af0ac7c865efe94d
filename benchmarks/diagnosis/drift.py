"""Learn how greenhouses change from a calibration to a later log, and what a change must gain, from nurseries.

In every nursery (one a season) each greenhouse is calibrated on eight weeks, and then logged three times more, with
nothing missing but a little drift, once with wrong noise or a cleaned cover. The rates that gains are judged under are
learned from the nurseries of the other seasons. No case of a benchmark has these seeds.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
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
FALSE_CLAIMS, FALSE_PATTERNS = 0.06, 0.02
"""Share of logs with nothing missing that the search may give a name, or a pattern, each greenhouse judged by the gains
of the others alone. By those of all it gives fewer, and unseen days refuse some names: `same` counts what is left."""
LEAST, MOST = 8, 40
"""Bounds that are tried."""


@dataclass(frozen=True)
class NullLog:
    """A later log in which nothing is missing."""

    season: str
    greenhouse: str
    group: str
    design: Design
    pair: Pair
    parameter_gains: dict[str, float]
    """Proven gain of every parameter, and of those that change together, where all else changes by physics alone."""


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
    # By physics alone: what was learned before would say something of what is learned now.
    design = history.expected(known, plain, history.expected_misfit(known, plain), (), Drift({}, BETWEEN))
    moved = parameter_gains(design)
    # What the search needs is in the products; the columns themselves would fill the memory.
    light = replace(design, values=design.values[:, :0], grams=_single(design))
    pair = sharing.pair(known, plain, light, BETWEEN)
    return NullLog(reference.greenhouse.site.name.split("-")[0], site.name, case.group, light, pair, moved)


def _single(design: Design) -> linear.DailyGrams:
    return linear.DailyGrams(design.grams.products.astype(np.float32), design.grams.fit)


def gains_under(log: NullLog, learned: Drift) -> dict[str, float]:
    """Return the proven gain of every effect in a log under a drift, the one that would be named first."""
    design = _under(log, learned)
    fitted = linear.fit(design.grams, design.null_model())
    rng = np.random.default_rng(0)
    return _by_gain(design, search.score_candidates(design, fitted, search.onset_days(design), rng))


def pattern_gains_under(log: NullLog, learned: Drift) -> dict[str, float]:
    """Return the same of every pattern."""
    design = _under(log, learned)
    fitted, onsets = linear.fit(design.grams, design.null_model()), search.onset_days(design)
    onsets = onsets[:: DEFAULT.pattern_onset_stride]
    return _by_gain(design, search.score_patterns(design, fitted, onsets, np.random.default_rng(0)))


def parameter_gains(by_physics: Design) -> dict[str, float]:
    """Return that of every parameter at its size, in the design of a log in which all else changes by physics alone."""
    design, rng = parameter_change.joined(by_physics), np.random.default_rng(0)
    fitted, onsets = linear.fit(design.grams, design.null_model()), search.onset_days(design)
    slopes = parameter_change.score(design, fitted, onsets, rng)
    return _by_gain(design, parameter_change.sized(design, slopes, rng))


def _by_gain(design: Design, scored: Sequence[search.Hypothesis]) -> dict[str, float]:
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


Claim = tuple[str, str, str]
"""Greenhouse, group and what is told of a log in which nothing is missing."""


def elsewhere(logs: Sequence[NullLog], gains: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Return for each log the largest gains in the greenhouses that it is not of."""
    return [
        largest([own for other, own in zip(logs, gains, strict=True) if other.greenhouse != log.greenhouse])
        for log in logs
    ]


def false_claims(
    logs: Sequence[NullLog], asked: Sequence[dict[str, float]], others: Sequence[dict[str, float]], least: float
) -> list[Claim]:
    """Return what is told of logs: of each the first that gains what it must, by its gains elsewhere."""
    claims = []
    for log, own, rest in zip(logs, asked, others, strict=True):
        told = (key for key, gain in own.items() if gain >= max(least, DEFAULT.change_over_null * rest.get(key, 0.0)))
        claims += [(log.greenhouse, log.group, key) for key in itertools.islice(told, 1)]
    return claims


def fitted_bound(what: str, claims: Callable[[float], list[Claim]], most: float) -> float:
    """Return the least bound by which no more logs than `most` are told something; print what is told."""
    print(f"logs with nothing missing that are told {what}, each greenhouse by the gains of the others:")
    least = float(MOST)
    for bound in range(MOST, LEAST - 1, -1):
        told = claims(bound)
        if len(told) > most or bound <= 2 * LEAST:
            print(f"  bound {bound}: {len(told)} {told}")
        if len(told) > most:
            break
        least = float(bound)
    return least


def false_parameters(logs: Sequence[NullLog], gains: Sequence[dict[str, float]]) -> list[str]:
    """Return the parameters that gain what they must, each greenhouse judged by the gains of the others."""
    least, over = DEFAULT.least_parameter_gain, DEFAULT.parameter_over_null
    return [
        f"{log.greenhouse} {key}"
        for log, own, rest in zip(logs, gains, elsewhere(logs, gains), strict=True)
        for key, gain in own.items()
        if gain >= max(least, over * rest.get(key, 0.0))
    ]


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
    patterns: list[dict[str, float]] = []
    for season in SEEDS:
        learned = learn([one for one in logs if one.season != season])
        for one in (one for one in logs if one.season == season):
            gains.append(gains_under(one, learned))
            patterns.append(pattern_gains_under(one, learned))
        print(f"{season}: judged under the rates of the other seasons", file=sys.stderr, flush=True)
    print(f"{len(logs)} logs")
    # Of causes that which gains most is named or none, of patterns any that gains what it must.
    first = [dict(itertools.islice(one.items(), 1)) for one in gains]
    causes = partial(false_claims, logs, first, elsewhere(logs, gains))
    least = fitted_bound("a cause", causes, FALSE_CLAIMS * len(logs))
    unexplained = partial(false_claims, logs, patterns, elsewhere(logs, patterns))
    of_pattern = fitted_bound("a pattern", unexplained, FALSE_PATTERNS * len(logs))
    moved = [one.parameter_gains for one in logs]
    print(f"parameters that would be named by the gains of other greenhouses: {false_parameters(logs, moved)}")
    found = learn(logs)
    for key, rate in sorted(found.rates.items(), key=lambda item: -item[1])[:20]:
        print(f"  {key:40} {rate:.3f}")
    done = replace(
        found,
        null_gains=largest(gains) | largest(patterns) | largest(moved),
        least_gain=least,
        least_pattern_gain=of_pattern,
        provenance=provenance(COMMAND, dict(SEEDS)),
    )
    path = Path(str(files("igrow.trainer.diagnosis"))) / drift.FILE
    drift.write_drift(path, done)
    print(f"least gain {least:g}, of a pattern {of_pattern:g}; wrote {path}")
    return 0
