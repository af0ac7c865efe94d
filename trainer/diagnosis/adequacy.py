"""Does the named cause explain what is there, or does something remain that no candidate explains?

A wrong name leaves structure: patterns in clock, calendar and weather that fit better than it, or still fit much
after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trainer.diagnosis import search, selection
from trainer.diagnosis.drivers import Pattern
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.search import Fit
from trainer.diagnosis.selection import Hypothesis, Selected

SMALLEST_GAIN = 16.0
"""Log-likelihood below which a pattern is no cause in a log of 28 days: a wrong structure makes as much."""
LARGEST_P_VALUE = 0.005
BETTER = 1.6
"""A pattern that gains so many times what the name gains replaces it."""
LEFT = 0.5
"""Share of the gain of the names found before that a pattern must add beside them: a form that is not quite the
catalogue's leaves traces."""
MOST_PATTERNS = 3


@dataclass(frozen=True)
class Adequacy:
    """The name that stands, or what remains where none does."""

    selected: Selected
    remainder: tuple[Hypothesis, ...] | None
    """Patterns that fit what no candidate explains; None where nothing remains."""
    pattern_gain: float
    """Of the best single pattern instead of the name."""


def judge(problem: Problem, chain: Sequence[Selected], explained: float, rng: np.random.Generator) -> Adequacy:
    """Judge the longest model of a chain against patterns.

    Args:
        problem: that it was found in.
        chain: from no name to the best one.
        explained: log-likelihood that the names found before, now part of the model, have gained.
        rng: for the flips.
    """
    none, named = chain[0], chain[-1]
    gained = named.fit.solution.gain - none.fit.solution.gain
    instead = _best(problem, none.fit, rng)
    gain = instead.gain if instead else 0.0
    if gain > max(SMALLEST_GAIN * selection.structural_growth(problem), BETTER * gained, LEFT * explained):
        return Adequacy(none, _patterns(problem, none.fit, rng), gain)
    return Adequacy(named, None, gain)


def _best(problem: Problem, fit: Fit, rng: np.random.Generator) -> Hypothesis | None:
    scored = selection.score_patterns(problem, fit, selection.onset_days(problem)[::4], rng)
    significant = [one for one in scored if one.p_value <= LARGEST_P_VALUE and one.gain >= _needed(problem, one)]
    return significant[0] if significant else None


def _needed(problem: Problem, one: Hypothesis) -> float:
    """Return the gain below which a pattern is not believed: a wrong model looks like one that is always there."""
    steady = isinstance(one.cause, Pattern) and not set(one.cause.drivers) - {"time"}
    return 2.0 * SMALLEST_GAIN * selection.structural_growth(problem) if steady else 0.0


def _patterns(problem: Problem, fit: Fit, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
    """Return up to three patterns, each significant beside those before it."""
    found: list[Hypothesis] = []
    current = fit
    for _ in range(MOST_PATTERNS):
        best = _best(problem, current, rng)
        if (
            best is None
            or best.gain < 0.5 * SMALLEST_GAIN * selection.structural_growth(problem)
            or not isinstance(best.cause, Pattern)
        ):
            break
        found.append(best)
        current = search.fit(problem.grams, current.model.with_term(best.term))
    amplitudes = np.asarray(current.amplitudes)[len(fit.model.terms) :]
    return tuple(
        Hypothesis(one.cause, one.term, one.gain, float(amplitude), one.statistic, one.p_value)
        for one, amplitude in zip(found, amplitudes, strict=True)
    )
