"""Logs of greenhouses in which nothing is missing: what a change must exceed comes of these.

In every nursery (one a season) each greenhouse is calibrated on eight weeks, and then logged three times more, with
nothing missing but a little drift, once with wrong noise or a cleaned cover. Of greenhouses of which the site's
description alone is known these logs tell something too, beside logs of other places and at any time of the year. No
case of a benchmark has these seeds.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace

from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.greenhouses import VirtualGreenhouse, others
from benchmarks.diagnosis.logs import Reference, built_in, simulate_cases
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later_logs, nursery
from benchmarks.jobs import Jobs
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.circumstances import Circumstances, circumstances_of

SEEDS = {"spring": 110_000, "autumn": 120_000, "winter": 130_000}
GREENHOUSES, DAYS = 16, 28
UNKNOWN_SEEDS, UNKNOWN = {"anywhere": 140_000}, 72
"""Of greenhouses anywhere, and how many."""
Later = tuple[Reference, Case, Telemetry]
"""A log in which nothing is missing, of a greenhouse, and the model that it is asked by."""


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


def circumstances(job: Later) -> Circumstances:
    """Return the circumstances of such a log, as a diagnosis has them."""
    reference, _, telemetry = job
    model = reference.model
    return circumstances_of(prepare_log(telemetry, reference.greenhouse.site), model, model.history, DEFAULT)


def by_the_built_in_bundle(logs: Sequence[Later]) -> list[Later]:
    """Return logs of greenhouses of which their site's description alone is known."""
    return [(replace(one, model=built_in(one.greenhouse.site)), case, log) for one, case, log in logs]


def unknown(jobs: Jobs) -> list[Later]:
    """Simulate greenhouses anywhere, at any time of the year, each with the built-in bundle; every third is noisy."""
    (first,) = UNKNOWN_SEEDS.values()
    greenhouses = others(UNKNOWN, first)
    cases = [
        Case(
            name=name, group=group, greenhouse=name, seed=first + 500 + place, heavy_tails=bool(place % 2),
            wrong_noise=group == "noise",
        )
        for place, (name, group) in enumerate(zip(greenhouses, itertools.cycle(("nothing", "nothing", "noise"))))
    ]  # fmt: skip
    found: list[Later] = []
    for one in jobs.each(_unknown, list(zip(greenhouses.values(), cases, strict=True))):
        found.append(one)
        print(f"{len(found)} of {len(cases)} unknown greenhouses", file=sys.stderr, flush=True)
    return found


def _unknown(job: tuple[VirtualGreenhouse, Case]) -> Later:
    greenhouse, case = job
    described = Reference(greenhouse, built_in(greenhouse.site), {}, None)
    (log,) = simulate_cases(described, [case], DAYS)
    return described, case, log


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
