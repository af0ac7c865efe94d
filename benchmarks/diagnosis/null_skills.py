"""Learn what a change that only unseen days tell must take off their errors: more than where there is none.

Asked of the same logs in which nothing is missing that teach what a change must gain (`null-gains`). An effect must
exceed `OVER_NULL` times what it took off in any of these logs. Above that stands what every change must take off: the
least with which none of these logs gets a name, each greenhouse judged by the others. No case of a benchmark has these
seeds.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import Case
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.null_gains import SEEDS, largest, unchanged
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT, cross_validation, null_gains
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.null_gains import NullGains
from igrow.trainer.diagnosis.rounds import Change, search_of

COMMAND = "python -m benchmarks.diagnosis null-skills"
OVER_NULL = 1.3
"""Times the most that an effect takes off where nothing has changed."""


@dataclass(frozen=True)
class Told:
    """What unseen days tell of one log in which nothing is missing."""

    greenhouse: str
    group: str
    skills: dict[str, float]
    """Share of their squared error that each effect takes off, of those that were asked; the largest first."""


def told(job: tuple[Reference, Case, Telemetry]) -> Told:
    """Ask a log, as a diagnosis does where its time steps tell nothing, whether or not those of this one do."""
    reference, case, telemetry = job
    site, rng = reference.greenhouse.site, np.random.default_rng(0)
    log = prepare_log(telemetry, site)
    knowledge, days = knowledge_of(reference.model, site, DEFAULT), log_days(log, reference.model)
    search = search_of(days, site, knowledge, frozenset(), DEFAULT, None, None)
    assert isinstance(search, Change)
    design = search.resolved()
    promising = cross_validation.promising(design, rng)
    found = cross_validation.cross_validated(design, knowledge.by_physics(DEFAULT), promising)
    ranked = sorted(found, key=lambda one: -one.skill)
    return Told(site.name, case.group, {one.hypothesis.effect: one.skill for one in ranked})


def of_each(found: Sequence[Told]) -> dict[str, float]:
    """Return what each effect must exceed by itself."""
    taken = largest([{effect: OVER_NULL * skill for effect, skill in one.skills.items()} for one in found])
    return {effect: skill for effect, skill in taken.items() if skill > 0.0}


def least_skill(found: Sequence[Told]) -> float:
    """Return the least that every change must take off, so that no log gets a name by what others take off."""
    told = [0.0]
    for one in found:
        by_others = of_each([other for other in found if other.greenhouse != one.greenhouse])
        effect, skill = next(iter(one.skills.items()), ("", 0.0))
        if skill >= by_others.get(effect, 0.0):
            told.append(skill)
    return (math.floor(1000.0 * max(told)) + 1.0) / 1000.0


def main(processes: int) -> int:
    """Write the bounds into the package."""
    found: list[Told] = []
    with Jobs("diagnosis null-skills", processes) as jobs:
        for one in jobs.each(told, unchanged(jobs)):
            found.append(one)
            print(f"{len(found)}: {one}", file=sys.stderr, flush=True)
    for one in sorted(found, key=lambda one: -max(one.skills.values(), default=0.0)):
        for effect, skill in one.skills.items():
            print(f"{one.greenhouse:24} {one.group:8} {effect:32} {skill:6.3f}")
    learned = NullGains(of_each(found), least_skill(found), provenance(COMMAND, dict(SEEDS)))
    path = Path(str(files("igrow.trainer.diagnosis"))) / null_gains.SKILLS_FILE
    path.write_text(json.dumps(asdict(learned), indent=1) + "\n", encoding="utf-8")
    print(f"{len(found)} logs; least skill {learned.least:g}; wrote {path}")
    return 0
