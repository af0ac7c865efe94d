"""Learn what a change must gain: more than effects and parameters do in greenhouses in which nothing has changed.

What an effect gained in any of these logs is what it must exceed. Above that stands what every change must gain: the
least with which no more of these logs get a name than may, each place judged by the gains of the others.
"""

from __future__ import annotations

import bisect
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.diagnosis.null_logs import Later, circumstances, place
from benchmarks.jobs import Jobs
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX
from igrow.trainer.diagnosis.learned.null_gains import BEGINNING_PREFIX, NullGains
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import change, parameter_change, scan
from igrow.trainer.diagnosis.search.rounds import search_of
from igrow.trainer.diagnosis.visible_parameters import members

LEAST, MOST = 8, 60
"""Bounds that are tried."""


@dataclass(frozen=True)
class Gained:
    """What was gained in such a log, that first which would be named."""

    place: float
    """Its latitude."""
    greenhouse: str
    effects: dict[str, float]
    beginnings: dict[str, float]
    """Of effects within the log, beyond what they gain there all the time."""
    parameters: dict[str, float]

    @property
    def all(self) -> dict[str, float]:
        """By the names of `NullGains.largest`."""
        begun = {BEGINNING_PREFIX + name: gain for name, gain in self.beginnings.items()}
        return self.effects | begun | self.parameters


def gained(job: Later) -> Gained:
    """Return the gains of every effect and parameter in a log."""
    site, log = job[0].greenhouse.site, circumstances(job)
    design = search_of(log.completed.days, site, log.knowledge, frozenset(), log.rules).design(())
    fitted, rng = linear.fit(design.grams, design.null_model()), np.random.default_rng(0)
    ranked = sorted(change.scored(design, fitted, rng), key=lambda one: -change.net_gain(design, one))
    effects = {one.effect: change.proven_gain(design, one) for one in ranked}
    beginnings = {one.effect: change.proven_begun_gain(design, one) for one in ranked if one.always is not None}
    if log.knowledge.history is None:
        # Nobody knows what a parameter was.
        return Gained(place(job), site.name, effects, beginnings, {})
    joined = parameter_change.joined(design)
    scored = parameter_change.score(
        joined, linear.fit(joined.grams, joined.null_model()), scan.onset_days(joined), np.random.default_rng(0)
    )
    parameters = {one.key: change.proven_gain(joined, one) for one in scored}
    asked = {
        key: gain
        for key, gain in parameters.items()
        if log.not_asked.isdisjoint(members(key.removeprefix(PARAMETER_PREFIX)))
    }
    return Gained(place(job), site.name, effects, beginnings, asked)


def largest(gains: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the largest gain of every effect."""
    names = sorted({name for one in gains for name in one})
    return {name: float(f"{max(0.0, *(one.get(name, 0.0) for one in gains)):.3g}") for name in names}


def of_others(found: Sequence[Gained], here: float, least: float) -> NullGains:
    """Return what greenhouses at places other than one have gained."""
    return NullGains(largest([one.all for one in found if one.place != here]), least)


def is_asked(one: Gained, known: NullGains) -> bool:
    """Tell whether an effect gains what it must, or what begins within the log: a diagnosis may name it."""
    return any(gain >= known.needed(name) for name, gain in one.all.items() if name not in one.parameters)


def named(job: tuple[Later, NullGains]) -> tuple[str, ...]:
    """Return what a diagnosis names in a log, by the gains at other places."""
    (reference, _, telemetry), known = job
    told = diagnose(prepare_log(telemetry, reference.greenhouse.site), reference.model, null_gains=known)
    return tuple(one.effect for one in told.findings)


def false_parameters(found: Sequence[Gained]) -> list[str]:
    """Return the parameters that gain what they must, each place judged by the gains of the others."""
    claims = []
    for one in found:
        known = of_others(found, one.place, LEAST).largest
        claims += [
            f"{one.greenhouse} {key}"
            for key, gain in one.parameters.items()
            if gain >= max(DEFAULT.least_parameter_gain, DEFAULT.parameter_over_null * known.get(key, 0.0))
        ]
    return claims


def least_gain(jobs: Jobs, logs: Sequence[Later], found: Sequence[Gained], may: int) -> float:
    """Return the least that every change must gain, so that no more of these logs are given a name than may be."""

    def names_few(least: int) -> bool:
        known = [of_others(found, one.place, float(least)) for one in found]
        asked = [number for number, (one, mine) in enumerate(zip(found, known, strict=True)) if is_asked(one, mine)]
        told = list(jobs.each(named, [(logs[number], known[number]) for number in asked]))
        claims = [(found[number].greenhouse, names) for number, names in zip(asked, told, strict=True) if names]
        print(f"  least gain {least}: {len(asked)} gain what they must; named: {len(claims)} {claims}", flush=True)
        return len(claims) <= may

    tried = range(LEAST, MOST + 1)
    first = bisect.bisect_left(tried, True, key=names_few)
    if first == len(tried):
        raise SystemExit(
            f"with {MOST} nats more than {may} of these logs are given a name still: look at what they show"
        )
    return float(tried[first])


def learn(jobs: Jobs, logs: Sequence[Later], made: Mapping[str, Any], false_claims: float) -> NullGains:
    """Return the gains that come with the trainer.

    Args:
        jobs: that diagnose.
        logs: in which nothing has changed.
        made: provenance of them.
        false_claims: share of them that may be given a name, each place judged by the others.
    """
    found: list[Gained] = []
    for one in jobs.each(gained, logs):
        found.append(one)
        print(f"gains of {len(found)} of {len(logs)} logs", file=sys.stderr, flush=True)
    print(f"{len(found)} logs with nothing missing; each place by the gains of the others:")
    least = least_gain(jobs, logs, found, int(false_claims * len(found)))
    print(f"parameters that would be named by the gains at other places: {false_parameters(found)}")
    return NullGains(largest([one.all for one in found]), least, made)
