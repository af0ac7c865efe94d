"""Learn what a change must gain: more than effects and parameters do in greenhouses in which nothing has changed.

What an effect gained in any of these logs is what it must exceed. Above that stands what every change must gain: the
least with which these logs, each greenhouse judged by the gains of the others, get a name no more often than they may.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.diagnosis.null_logs import Later, circumstances
from benchmarks.jobs import Jobs
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import change, diagnose, history, linear, parameter_change, search
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX
from igrow.trainer.diagnosis.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.visible_parameters import members

FALSE_CLAIMS = 0.02
"""Share of logs with nothing missing that may be given a name, each greenhouse judged by the gains of the others."""
LEAST, MOST = 8, 30
"""Bounds that are tried."""


@dataclass(frozen=True)
class Gained:
    """What was gained in such a log, that first which would be named."""

    greenhouse: str
    group: str
    effects: dict[str, float]
    parameters: dict[str, float]


def gained(job: Later) -> Gained:
    """Return the gains of every effect and parameter in a log."""
    reference, case, _ = job
    known, site, log = reference.model.history, reference.greenhouse.site, circumstances(job)
    assert known is not None
    days, rules = log.completed.days, log.rules
    plain = history.laid_out(days, site, known, (), rules)
    design = history.expected(known, plain, history.expected_misfit(known, plain))
    effects = _gains(design, search.score_candidates)
    parameters = _gains(parameter_change.joined(design), parameter_change.score)
    asked = {
        key: gain
        for key, gain in parameters.items()
        if log.not_asked.isdisjoint(members(key.removeprefix(PARAMETER_PREFIX)))
    }
    return Gained(site.name, case.group, effects, asked)


def _gains(design: Design, score: Callable[..., list[search.Hypothesis]]) -> dict[str, float]:
    """Return the proven gain of all, that first which would be named."""
    fitted = linear.fit(design.grams, design.null_model())
    scored = score(design, fitted, search.onset_days(design), np.random.default_rng(0))
    ranked = sorted(scored, key=lambda one: -change.net_gain(design, one))
    return {one.key: change.proven_gain(design, one) for one in ranked}


def largest(gains: Sequence[Mapping[str, float]]) -> dict[str, float]:
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


def learn(jobs: Jobs, logs: Sequence[Later], made: Mapping[str, Any]) -> NullGains:
    """Return the gains that come with the trainer.

    Args:
        jobs: that diagnose.
        logs: in which nothing has changed.
        made: provenance of them.
    """
    found: list[Gained] = []
    for one in jobs.each(gained, logs):
        found.append(one)
        print(f"gains of {len(found)} of {len(logs)} logs", file=sys.stderr, flush=True)
    print(f"{len(found)} logs with nothing missing; each greenhouse by the gains of the others:")
    least = least_gain(jobs, logs, found)
    print(f"parameters that would be named by the gains of other greenhouses: {false_parameters(found)}")
    gains = largest([one.effects for one in found]) | largest([one.parameters for one in found])
    return NullGains(gains, least, made)
