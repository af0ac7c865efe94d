"""Logs of greenhouses in which nothing is missing: what a change must exceed comes of these.

In every nursery (three a season) each greenhouse is calibrated on eight weeks, and then logged three times more, with
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
from benchmarks.diagnosis.makers import Maker
from benchmarks.diagnosis.nurseries import Nursery, calibrated, calibration_logs, later_logs, nurseries, nursery
from benchmarks.jobs import Jobs
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.circumstances import Circumstances, circumstances_of

SEEDS = {"spring": 110_000, "autumn": 120_000, "winter": 130_000}
GREENHOUSES, DAYS = 16, 28
MORE_SEEDS, MORE_GREENHOUSES = {"two places a season": 250_000}, 8
"""Of the first of six further places, and how many greenhouses at each: three places alone say too little of others."""
FALSE_CLAIMS = 0.02
"""Share of these logs that may be told something, each place judged by the others."""
UNKNOWN_SEEDS, UNKNOWN = {"anywhere": 140_000}, 72
"""Of greenhouses anywhere, and how many."""
Later = tuple[Reference, Case, Telemetry]
"""A log in which nothing is missing, of a greenhouse, and the model that it is asked by."""


def places() -> list[Nursery]:
    """Draw the nurseries that bounds are learned of."""
    (more,) = MORE_SEEDS.values()
    return [
        *(nursery(season, GREENHOUSES, first) for season, first in SEEDS.items()),
        *nurseries(more, MORE_GREENHOUSES),
    ]


def place(job: Later) -> float:
    """Return what tells a log's place from all others: its latitude, of which greenhouses of one nursery have one."""
    return job[0].greenhouse.site.latitude


def null_cases(known: Nursery) -> list[list[Case]]:
    """Return three cases of every greenhouse in which nothing is missing."""
    season, found = known.season, []
    for place, one in enumerate(known.greenhouses):
        groups = ("nothing", "nothing", "clean" if place % 2 else "noise")
        found.append([
            Case(
                name=f"{season}-{place}-{number}", group=group, greenhouse=one.site.name,
                seed=known.seed + 500 + 3 * place + number, heavy_tails=bool(number), wrong_noise=group == "noise",
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


def unchanged(jobs: Jobs, known: Sequence[Nursery]) -> list[Later]:
    """Simulate nurseries and calibrate their greenhouses; return the later logs in which nothing is missing."""
    weeks = jobs.each(calibration_logs, known)
    own = [pair for one, logs in zip(known, weeks, strict=True) for pair in zip(one.greenhouses, logs, strict=True)]
    references: list[Reference] = []
    for reference in jobs.each(calibrated, own):
        references.append(reference)
        print(f"{len(references)} of {len(own)} calibrated", file=sys.stderr, flush=True)
    every = iter(references)
    by_place = [list(itertools.islice(every, len(one.greenhouses))) for one in known]
    cases = [null_cases(one) for one in known]
    asked = [(found, mine, one.maker) for found, mine, one in zip(by_place, cases, known, strict=True)]
    return [
        (one, case, log)
        for (greenhouses, own_cases, _), later in zip(asked, jobs.each(_later, asked), strict=True)
        for one, mine, seen in zip(greenhouses, own_cases, later, strict=True)
        for case, log in zip(mine, seen, strict=True)
    ]


def _later(job: tuple[Sequence[Reference], Sequence[Sequence[Case]], Maker]) -> list[list[Telemetry]]:
    known, cases, maker = job
    return later_logs(known, cases, DAYS, maker)
