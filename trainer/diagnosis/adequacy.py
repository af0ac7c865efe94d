"""Does the named cause explain what is there, or does something remain that no candidate explains?

A wrong name leaves structure: patterns in clock, calendar and weather that fit better than it, or still fit much
after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from igrow.trainer.diagnosis import search, selection
from igrow.trainer.diagnosis.drivers import Pattern
from igrow.trainer.diagnosis.likelihood import Profile
from igrow.trainer.diagnosis.problem import HOUR, Problem
from igrow.trainer.diagnosis.selection import Contender, Hypothesis, Selected

SMALLEST_GAIN = 40.0
"""Log-likelihood below which a pattern is no cause in a log of 28 days: a wrong structure makes as much in four of
a hundred tuning logs with nothing hidden of greenhouses that the usual directions were not learned from."""
SMALLEST_GAIN_ELSEWHERE = 65.0
"""The same for a model that was calibrated on another greenhouse: less in 47 of 48 tuning logs."""
STEADY = 2.0
"""Times as much is asked of a pattern of the clock alone: a wrong model looks like one that is always there."""
LARGEST_DOUBT = 0.5
"""Bootstrap probability that unseen days are not likelier with a pattern: one that lives on two Sundays fits them."""
BETTER = 2.2
"""A pattern that gains so many times what the name gains replaces it."""
LEFT = 1.0
"""Share of the gain of the names found before that a pattern must add beside them: a form that is not quite the
catalogue's leaves traces as large as half of it."""
FURTHER = 8.0
"""Log-likelihood that each further pattern must add in a log of 28 days."""
MOST_PATTERNS = 3
USUAL_DAYS = 28
"""Length of the logs that gains were fitted on."""


@dataclass(frozen=True)
class Adequacy:
    """The name that stands, or what remains where none does."""

    selected: Selected
    remainder: tuple[Hypothesis, ...] | None
    """Patterns that fit what no candidate explains; None where nothing remains."""


def judge(
    problem: Problem, none: Profile, cause: Contender | None, explained: float, rng: np.random.Generator
) -> Adequacy:
    """Judge the best cause of a round against patterns.

    Args:
        problem: that it was found in.
        none: the model without it.
        cause: the best one, if there is one.
        explained: log-likelihood that the names found before, now part of the model, have gained.
        rng: for the flips.
    """
    growth = _growth(problem)
    fit = search.fit(problem.grams, none.model)
    ranked = selection.score_patterns(problem, fit, selection.onset_days(problem)[::4], rng)
    instead = selection.contest(problem, none, ranked, rng)
    gained = cause.hypothesis.gain if cause else 0.0
    smallest = growth * (SMALLEST_GAIN_ELSEWHERE if problem.elsewhere else SMALLEST_GAIN)
    needed = max(smallest, BETTER * gained, LEFT * explained)
    for pattern in (one for one in instead if one.doubt <= LARGEST_DOUBT):
        least = STEADY * smallest if _steady(pattern.hypothesis) else 0.0
        if pattern.hypothesis.gain > max(needed, least):
            seen = problem.whitened(pattern.profile.whitening)
            return Adequacy(selection.selected(problem, none, None), _patterns(seen, pattern, growth, rng))
    return Adequacy(selection.selected(problem, none, cause), None)


def _growth(problem: Problem) -> float:
    """Return how many times as much as in `USUAL_DAYS` patterns gain from a wrong structure: the same every day.

    Where the structure is right (errors count row by row), nothing grows.
    """
    # The first local day is seldom a whole one.
    return max(1.0, (problem.split.days - 1) / USUAL_DAYS) if problem.interval >= HOUR else 1.0


def _steady(one: Hypothesis) -> bool:
    return isinstance(one.cause, Pattern) and not set(one.cause.drivers) - {"time"}


def _patterns(problem: Problem, first: Contender, growth: float, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
    """Return up to three patterns, each significant beside those before it."""
    found = [first.hypothesis]
    current = search.fit(problem.grams, first.profile.model)
    before = len(current.model.terms) - 1
    while len(found) < MOST_PATTERNS:
        ranked = selection.score_patterns(problem, current, selection.onset_days(problem)[::4], rng)
        passed = [
            one
            for one in ranked
            if one.p_value <= selection.LARGEST_P_VALUE
            and one.gain >= FURTHER * growth * (2.0 * STEADY if _steady(one) else 1.0)
        ]
        if not passed:
            break
        found.append(passed[0])
        current = search.fit(problem.grams, current.model.with_term(passed[0].term))
    amplitudes = np.asarray(current.amplitudes)[before:]
    return tuple(replace(one, amplitude=float(amplitude)) for one, amplitude in zip(found, amplitudes, strict=True))
