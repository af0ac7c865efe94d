"""The best cause over all effects, shapes and beginnings, with the price of searching paid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis import likelihood, search
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.drivers import Pattern
from igrow.trainer.diagnosis.gram import Floats, Term
from igrow.trainer.diagnosis.likelihood import Profile
from igrow.trainer.diagnosis.problem import HOUR, Problem
from igrow.trainer.diagnosis.search import Fit

CONTENDERS = 8
"""Best causes of a scan that are compared, each beside its own noise."""
CHANCE = 7.0
"""Log-likelihood that chance and searching bring at most."""
STRUCTURE = 22.0
"""The same with what a wrong structure brings in a log of four weeks: less in seven of eight tuning logs
with nothing hidden of greenhouses that the usual directions were not learned from."""
STRUCTURE_ELSEWHERE = 26.0
"""The same for a model that was calibrated on another greenhouse: less in 45 of 48 tuning logs."""
BEYOND_USUAL = 9.0
"""What must be left of it when the usual size of an effect is allowed for."""
LARGEST_P_VALUE = 0.005
"""Of the day-block max-T test, the price of searching paid."""
BEYOND = 1.5
"""How far, as a multiple, a linear fit may go beyond a bound: the truth may stand at it."""
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
class Contender:
    """A hypothesis beside the noise that it leaves."""

    hypothesis: Hypothesis
    """Its gain is that of the profile likelihood."""
    evidence: float
    """The gain that is left when its usual size in logs with nothing missing is allowed for, less an onset's price."""
    profile: Profile
    doubt: float
    """Probability that unseen days are not likelier with it."""


@dataclass(frozen=True)
class Selected:
    """What a round of the search found, under one noise."""

    problem: Problem
    """Under the noise that is left beside the cause."""
    none: Fit
    """The model without a cause."""
    named: Fit
    """The model with the cause, or that without where there is none."""
    cause: Contender | None


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


def contest(problem: Problem, none: Profile, ranked: Sequence[Hypothesis], rng: np.random.Generator) -> list[Contender]:
    """Return the first of `ranked` that pass the test, each beside its own noise, the likeliest first."""
    passed = [one for one in ranked if one.p_value <= LARGEST_P_VALUE]
    contenders = []
    for one in passed[:CONTENDERS]:
        own = likelihood.profile(problem, none.model.with_term(one.term), none.whitening)
        gain = likelihood.gain(problem, own, none)
        price = 0.0 if one.term.onset is None else ONSET_PRICE
        # With a normal prior of the usual size on the amplitude, so much of the gain is beyond the usual.
        beyond = 1.0 / (1.0 + (problem.usual_size.get(one.effect, 0.0) / own.deviations[-1]) ** 2)
        doubt = likelihood.doubt(problem, own, none, rng)
        contenders.append(Contender(replace(one, gain=gain - price), gain * beyond - price, own, doubt))
    return sorted(contenders, key=lambda one: -one.hypothesis.gain)


def best_cause(problem: Problem, none: Profile, rng: np.random.Generator) -> Contender | None:
    """Return the best cause of a log, within its bounds; None where none gains what is needed.

    Args:
        problem: of the log.
        none: the model without a cause.
        rng: for the flips.
    """
    fit = search.fit(problem.grams, none.model)
    ranked = score_candidates(problem, fit, onset_days(problem), rng)
    for one in contest(problem, none, ranked, rng):
        if _suffices(problem, one) and _within_bounds(one):
            return one
    return None


def selected(problem: Problem, none: Profile, cause: Contender | None) -> Selected:
    """Return both models under the noise that is left beside the cause."""
    if cause is None:
        fit = search.fit(problem.grams, none.model)
        return Selected(problem, fit, fit, None)
    seen = problem.whitened(cause.profile.whitening)
    return Selected(seen, search.fit(seen.grams, none.model), search.fit(seen.grams, cause.profile.model), cause)


def _suffices(problem: Problem, contender: Contender) -> bool:
    """Tell whether a cause gains more than chance does and, where errors count by hours, than a wrong structure."""
    if problem.interval < HOUR:
        return contender.hypothesis.gain >= CHANCE
    needed = STRUCTURE_ELSEWHERE if problem.elsewhere else STRUCTURE
    return contender.hypothesis.gain >= needed and contender.evidence >= BEYOND_USUAL


def _within_bounds(contender: Contender) -> bool:
    bounds = EFFECTS[contender.hypothesis.effect].amplitude
    (amplitude,) = contender.profile.amplitudes
    return BEYOND * bounds.low <= amplitude <= BEYOND * bounds.high and (bounds.low < 0.0 or amplitude > 0.0)
