"""Learn what a change that only fits tell must take off the error of unseen days: more than where there is none.

Asked of the same logs in which nothing is missing that teach what a change must gain (`null-gains`), where the time
steps tell nothing. No case of a benchmark has these seeds.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.null_gains import SEEDS, unchanged
from benchmarks.diagnosis.rules import RULES, write_rules
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT, fitted_change
from igrow.trainer.diagnosis.change import changed
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.rounds import Change, search_of

COMMAND = "python -m benchmarks.diagnosis fitted-change"
OVER_NULL = 1.3
"""Times the most that goes where nothing has changed."""


@dataclass(frozen=True)
class Told:
    """What fits tell of one log in which nothing is missing."""

    greenhouse: str
    group: str
    effect: str
    """That which takes most off unseen days; empty for none."""
    fall: float
    """Share of the error of unseen days that it removes."""


def told(job: tuple[Reference, Case, Telemetry]) -> Told:
    """Ask a log, as a diagnosis does where its time steps tell nothing."""
    reference, case, telemetry = job
    site, rng = reference.greenhouse.site, np.random.default_rng(0)
    log = prepare_log(telemetry, site)
    knowledge, days = knowledge_of(reference.model, site, DEFAULT), log_days(log, reference.model)
    search = search_of(days, site, knowledge, frozenset(), DEFAULT, None, None)
    assert isinstance(search, Change)
    design = search.resolved()
    judged = changed(design, 0.0, rng)
    if judged.cause is not None or judged.patterns:
        return Told(site.name, case.group, "", 0.0)
    asked = fitted_change.promising(design, rng)
    found = fitted_change.best(fitted_change.fitted(days, knowledge, design, asked))
    return (
        Told(site.name, case.group, "", 0.0)
        if found is None
        else Told(site.name, case.group, found.hypothesis.effect, found.fall)
    )


def main(processes: int) -> int:
    """Write the bound into the package."""
    found: list[Told] = []
    with Jobs("diagnosis fitted-change", processes) as jobs:
        for one in jobs.each(told, unchanged(jobs)):
            found.append(one)
            print(f"{len(found)}: {one}", file=sys.stderr, flush=True)
    for one in sorted(found, key=lambda one: -one.fall):
        if one.effect:
            print(f"{one.greenhouse:24} {one.group:8} {one.effect:32} {100.0 * one.fall:5.1f} %")
    least = round(OVER_NULL * max(one.fall for one in found), 3)
    write_rules(RULES, {"least_change_fall": least}, provenance(COMMAND, dict(SEEDS)))
    print(f"{len(found)} logs; least fall {least:g}; wrote {RULES}")
    return 0
