"""The best cause over all effects, shapes and beginnings, with the price of searching paid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from igrow_core.effects import EFFECTS
from trainer.diagnosis import search
from trainer.diagnosis.candidates import Candidate
from trainer.diagnosis.drivers import Pattern
from trainer.diagnosis.gram import Floats, Term, day_losses
from trainer.diagnosis.problem import HOUR, Problem
from trainer.diagnosis.search import Fit, Model

REFITTED = 3
"""Best causes of a scan that are fitted to be compared."""
SMALLEST_GAIN = 9.0
"""Log-likelihood that a term must add on the fit days of a log of `USUAL_DAYS`."""
USUAL_DAYS = 28
"""Length of the logs that thresholds were fitted on."""
LARGEST_P_VALUE = 0.005
"""Of the day-block max-T test, the price of searching paid."""
ONSET_PRICE = 9.0
"""Log-likelihood that a beginning within the log must add over an effect that was always there."""
FIRST_ONSET_DAYS = 3
"""No beginning is looked for within so many days of either end."""
MOST_ONSETS = 30
"""Beginnings tried in a log; longer logs are tried every few days, then day by day around the best."""


@dataclass(frozen=True)
class Hypothesis:
    """One candidate (or pattern) as a term, with what it would gain in the model it was scored against."""

    cause: Candidate | Pattern
    term: Term
    gain: float
    amplitude: float
    statistic: float
    p_value: float

    @property
    def effect(self) -> str:
        """Name of the effect; a pattern has none."""
        return self.cause.effect if isinstance(self.cause, Candidate) else ""


@dataclass(frozen=True)
class Selected:
    """A model with named terms, and its fit."""

    hypotheses: tuple[Hypothesis, ...]
    fit: Fit


def structural_growth(problem: Problem) -> float:
    """Return how many times as much log-likelihood as in `USUAL_DAYS` a wrong structure brings in this log.

    Chance brings no more in a longer log; what the balances lack brings as much every day. Where the structure is
    right (errors count row by row), nothing grows.
    """
    # The first local day is seldom a whole one.
    return max(1.0, (problem.split.days - 1) / USUAL_DAYS) if problem.interval >= HOUR else 1.0


def onset_days(problem: Problem) -> list[int | None]:
    """Return the days of beginning worth trying; None is always."""
    last = problem.split.days - FIRST_ONSET_DAYS
    step = max(1, -(-(last - FIRST_ONSET_DAYS) // MOST_ONSETS))
    return [None, *range(FIRST_ONSET_DAYS, last + 1, step)]


def score_candidates(
    problem: Problem, current: Fit, onsets: Sequence[int | None], rng: np.random.Generator
) -> list[Hypothesis]:
    """Return the best hypothesis of every effect, the likeliest first."""
    ageing = [
        shift if candidate.ages else None for shift, candidate in zip(problem.ageing, problem.candidates, strict=True)
    ]
    bounds = np.array([(one.definition.amplitude.low, one.definition.amplitude.high) for one in problem.candidates])
    scanned = search.scan(problem.grams, current, list(problem.candidate), ageing, onsets, bounds, rng)
    return _best(scanned, problem.candidates, ageing, [one.effect for one in problem.candidates])


def middle_of_best(gains: Floats) -> int:
    """Return the position of the largest gain, the middle one of several.

    Held-out days tell nothing: within a block of them all beginnings are as likely, and the middle is the least wrong.
    """
    ties = np.flatnonzero(gains >= gains.max() - 1e-9)
    return int(ties[len(ties) // 2])


def score_patterns(
    problem: Problem, current: Fit, onsets: Sequence[int | None], rng: np.random.Generator
) -> list[Hypothesis]:
    """Return every pattern as a hypothesis, the likeliest first."""
    count = len(problem.patterns)
    bounds = np.tile([-1e9, 1e9], (count, 1))
    none: list[int | None] = [None] * count
    scanned = search.scan(problem.grams, current, list(problem.pattern), none, onsets, bounds, rng)
    return _best(scanned, problem.patterns, none, list(range(count)))


def _best(
    scanned: search.Scan,
    causes: Sequence[Candidate] | Sequence[Pattern],
    ageing: Sequence[int | None],
    groups: Sequence[object],
) -> list[Hypothesis]:
    price = np.array([0.0 if onset is None else ONSET_PRICE for onset in scanned.onsets])
    merit = scanned.gain - price[:, None]
    found: dict[object, Hypothesis] = {}
    rows = np.array([middle_of_best(column) for column in merit.T], dtype=np.int64)
    for column in np.argsort(-merit[rows, np.arange(merit.shape[1])]):
        row = rows[column]
        if groups[column] in found or merit[row, column] <= 0.0:
            continue
        onset = scanned.onsets[row]
        found[groups[column]] = Hypothesis(
            causes[column],
            Term(int(scanned.columns[column]), onset, ageing[column] if onset is not None else None),
            float(merit[row, column]),
            float(scanned.amplitude[row, column]),
            float(scanned.statistic[row, column]),
            float(scanned.p_value[row, column]),
        )
    return list(found.values())


def no_cause(problem: Problem, null: Model) -> tuple[Selected]:
    """Return the chain that holds the model without a cause alone."""
    return (Selected((), search.fit(problem.grams, null)),)


def best_cause(problem: Problem, null: Model, rng: np.random.Generator) -> tuple[Selected, ...]:
    """Return the model without a cause and, where one passes the test, that with the best, within its bounds."""
    (none,) = no_cause(problem, null)
    ranked = score_candidates(problem, none.fit, onset_days(problem), rng)
    needed = SMALLEST_GAIN * structural_growth(problem)
    passed = [one for one in ranked if one.gain >= needed and one.p_value <= LARGEST_P_VALUE]
    grown = [Selected((one,), search.fit(problem.grams, null.with_term(one.term))) for one in passed[:REFITTED]]
    grown = [one for one in grown if _within_bounds(one)]
    return (none, max(grown, key=lambda one: one.fit.solution.gain)) if grown else (none,)


def _within_bounds(selected: Selected) -> bool:
    for hypothesis, amplitude in zip(selected.hypotheses, selected.fit.amplitudes, strict=True):
        bounds = EFFECTS[hypothesis.effect].amplitude
        if not bounds.low <= amplitude <= bounds.high or (bounds.low == 0.0 and amplitude <= 0.0):
            return False
    return True


def losses_by_day(problem: Problem, fit: Fit) -> Floats:
    """Return half the sum of squared innovations of every day under a fit, (days,)."""
    return day_losses(fit.products, fit.solution.coefficients)
