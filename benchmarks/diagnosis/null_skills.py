"""Learn what a change that only unseen days tell must take off their errors: more than where there is none.

An effect must exceed some times what it took off in any of these logs (`DecisionRules.days_over_null`), a pattern
without a name the same of any of its kind. Above that stands what every change must take off: the least with which
these logs, each place judged by the others, are told to lack one no more often than they may; of patterns the same.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.diagnosis.null_gains import largest
from benchmarks.diagnosis.null_logs import Later, circumstances, place
from benchmarks.jobs import Jobs
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.learned import null_gains
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import cross_validation, unexplained
from igrow.trainer.diagnosis.search.cross_validation import CrossValidated, cross_validated
from igrow.trainer.diagnosis.search.rounds import search_of

Skills = Mapping[str, float]
"""Share of the squared error of unseen days that each takes off; the largest first."""


@dataclass(frozen=True)
class Told:
    """What unseen days tell of one log in which nothing is missing."""

    place: float
    """Its latitude."""
    greenhouse: str
    group: str
    skills: dict[str, float]
    """Share of their squared error that each effect takes off, of those that were asked; the largest first."""
    patterns: dict[str, float]
    """The same of the best pattern of each kind."""


def told(job: Later) -> Told:
    """Ask a log, as a diagnosis does where its time steps tell nothing, whether or not those of this one do."""
    reference, case, _ = job
    site, rng, log = reference.greenhouse.site, np.random.default_rng(0), circumstances(job)
    knowledge, rules = log.knowledge, log.rules
    design = search_of(log.completed.days, site, knowledge, log.not_asked, rules).design(())
    by_physics = knowledge.by_physics(rules)
    effects = _ranked(cross_validated(design, by_physics, cross_validation.promising(design, rng)))
    patterns: dict[str, float] = {}
    for one in _ranked(unexplained.judged(design, site.longitude, by_physics).found):
        assert isinstance(one.hypothesis.cause, Pattern)
        patterns.setdefault(one.hypothesis.cause.kind, one.skill)
    return Told(place(job), site.name, case.group, {one.hypothesis.effect: one.skill for one in effects}, patterns)


def _ranked(found: Sequence[CrossValidated]) -> list[CrossValidated]:
    return sorted(found, key=lambda one: -one.skill)


def of_each(skills: Sequence[Skills]) -> dict[str, float]:
    """Return the most that each effect, or each kind of patterns, takes off."""
    return {name: skill for name, skill in largest(skills).items() if skill > 0.0}


def least_skill(found: Sequence[tuple[float, Skills]], false_claims: float) -> float:
    """Return the least that every change must take off, so that few enough logs are told one by what others take off.

    Args:
        found: place and skills of every log.
        false_claims: share of them that may be told one.
    """
    told = []
    for here, skills in found:
        by_others = of_each([other for elsewhere, other in found if elsewhere != here])
        best, skill = next(iter(skills.items()), ("", 0.0))
        if skill > 0.0 and skill >= DEFAULT.days_over_null * by_others.get(best, 0.0):
            told.append(skill)
    may = int(false_claims * len(found))
    least = sorted((0.0, *told), reverse=True)[min(may, len(told))]
    return (math.floor(1000.0 * least) + 1.0) / 1000.0


def learned(
    found: Sequence[Told], made: Mapping[str, Any], *, false_causes: float, false_patterns: float
) -> dict[str, NullGains]:
    """Return the bounds of effects and of patterns, by their file.

    Args:
        found: what unseen days tell of every log.
        made: provenance of these logs.
        false_causes: share of them that may be told an effect, each place judged by the others.
        false_patterns: the same of patterns.
    """
    by_file = {
        null_gains.SKILLS_FILE: ([(one.place, one.skills) for one in found], false_causes),
        null_gains.PATTERN_SKILLS_FILE: ([(one.place, one.patterns) for one in found], false_patterns),
    }
    return {
        file: NullGains(of_each([skills for _, skills in those]), least_skill(those, may), made)
        for file, (those, may) in by_file.items()
    }


def learn(
    jobs: Jobs, logs: Sequence[Later], made: Mapping[str, Any], *, false_causes: float, false_patterns: float
) -> dict[str, NullGains]:
    """Return the skills that come with the trainer, of effects and of patterns, by their file.

    Args:
        jobs: that ask the unseen days.
        logs: in which nothing has changed.
        made: provenance of them.
        false_causes: share of them that may be told an effect, each place judged by the others.
        false_patterns: the same of patterns.
    """
    found: list[Told] = []
    for one in jobs.each(told, logs):
        found.append(one)
        print(f"skills of {len(found)} of {len(logs)} logs", file=sys.stderr, flush=True)
    for one in sorted(found, key=lambda one: -max(one.skills.values(), default=0.0)):
        of_patterns = {f"pattern of {name}": skill for name, skill in one.patterns.items()}
        for name, skill in (one.skills | of_patterns).items():
            print(f"{one.greenhouse:24} {one.group:8} {name:32} {skill:6.3f}")
    return learned(found, made, false_causes=false_causes, false_patterns=false_patterns)
