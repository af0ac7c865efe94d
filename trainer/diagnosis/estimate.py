"""Size, interval, beginning, rivals and regimes of each selected term."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis import search, selection
from igrow.trainer.diagnosis.activation import ActiveTerm
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.gram import Term
from igrow.trainer.diagnosis.problem import Problem
from igrow.trainer.diagnosis.refine import Refined
from igrow.trainer.diagnosis.result import Interval, OnsetInterval
from igrow.trainer.diagnosis.search import Fit
from igrow.trainer.diagnosis.selection import Hypothesis, Selected

NORMAL_90 = 1.645
INFLATION = 1.3
"""Of the standard deviation of an amplitude, for the structure that no covariance knows (fitted on tuning cases)."""
FORM_DOUBT = 0.3
"""Relative standard deviation of an amplitude beside it: the truth is not quite of the catalogue's form, nor is the
simulator's response quite the greenhouse's (fitted on tuning cases)."""
RIVAL_GAIN = 6.0
"""Log-likelihood within which a rival fits as well."""
RIVAL_SHARE = 0.25
"""The same as a share of the term's own gain, for large effects: the truth is never quite of the catalogue's form."""


@dataclass(frozen=True)
class Estimated:
    """A term with everything that is known of it."""

    hypothesis: Hypothesis
    term: ActiveTerm
    amplitude: Interval
    gain: float
    """Log-likelihood that the term adds to the final model."""
    onset: OnsetInterval | None
    rivals: tuple[str, ...]
    shapes: dict[str, Interval] = field(default_factory=dict)
    regimes: dict[str, Interval] = field(default_factory=dict)
    effect_to_noise: float = 0.0
    skill: float = 0.0
    """Share of the squared error on unseen days that it removes."""
    doubt: float = 0.0
    """Probability that it does not make the free runs of unseen days likelier."""
    shift: dict[str, float] = field(default_factory=dict)
    """How the parameters move when the term comes in."""

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.hypothesis.effect


def estimate(selected: Selected, rng: np.random.Generator) -> list[Estimated]:
    """Return the cause that a round selected, if it did."""
    if selected.cause is None:
        return []
    problem, reduced, hypothesis = selected.problem, selected.none, selected.cause.hypothesis
    gain = selected.named.solution.gain - reduced.solution.gain
    (amplitude,) = (float(one) for one in selected.named.amplitudes)
    reach = NORMAL_90 * INFLATION * _sandwich(problem, selected.named)
    onset = _onset(problem, reduced, hypothesis)
    shape = _shape(problem, reduced, hypothesis)
    return [
        Estimated(
            hypothesis,
            ActiveTerm(hypothesis.effect, amplitude, shape, None if onset is None else onset.time),
            Interval(amplitude, amplitude - reach, amplitude + reach, EFFECTS[hypothesis.effect].amplitude.unit),
            hypothesis.gain,
            onset,
            rivals(problem, reduced, hypothesis, gain, rng),
            doubt=selected.cause.doubt,
            shift=_shift(problem, reduced, selected.named),
        )
    ]


def with_refined(one: Estimated, refined: Refined) -> Estimated:
    """Return the term with refitted values and their intervals."""
    definition = EFFECTS[one.effect]
    reach = NORMAL_90 * INFLATION
    amplitude = refined.term.amplitude
    shapes = {}
    for shape in definition.shapes:
        value = refined.term.shape[shape.name]
        wide = reach * refined.shape_deviation[shape.name]
        shapes[shape.name] = Interval(value, max(value - wide, shape.low), min(value + wide, shape.high), shape.unit)
    wide = NORMAL_90 * float(np.hypot(INFLATION * refined.deviation, FORM_DOUBT * amplitude))
    interval = Interval(amplitude, amplitude - wide, amplitude + wide, definition.amplitude.unit)
    regimes = {
        name: Interval(value, value - reach * deviation, value + reach * deviation, interval.unit)
        for name, (value, deviation) in refined.regimes.items()
    }
    return replace(one, term=refined.term, amplitude=interval, shapes=shapes, regimes=regimes)


def within_bounds(one: Estimated) -> Estimated:
    """Return the term with its size brought to the nearest bound, if it lies beyond."""
    bounds = EFFECTS[one.effect].amplitude
    size = float(np.clip(one.term.amplitude, bounds.low, bounds.high))
    interval = replace(one.amplitude, value=size, low=min(one.amplitude.low, size), high=max(one.amplitude.high, size))
    return replace(one, term=replace(one.term, amplitude=size), amplitude=interval)


def rivals(
    problem: Problem,
    reduced: Fit,
    hypothesis: Hypothesis,
    gain: float,
    rng: np.random.Generator,
) -> tuple[str, ...]:
    """Return the effects that would do as well in the place of a term, itself first.

    Args:
        problem: under the noise that is left beside the term.
        reduced: the model without it.
        hypothesis: the term.
        gain: of the term, scored as the others are.
        rng: for the flips.
    """
    margin = max(RIVAL_GAIN, RIVAL_SHARE * gain)
    onsets = selection.onset_days(problem) if hypothesis.term.onset is not None else [None]
    scored = selection.score_candidates(problem, reduced, onsets, rng)
    as_good = [one.effect for one in scored if one.gain >= gain - margin]
    return (hypothesis.effect, *(name for name in as_good if name != hypothesis.effect))


def _shift(problem: Problem, reduced: Fit, full: Fit) -> dict[str, float]:
    count = len(problem.parameter)
    change = full.solution.coefficients[:count] - reduced.solution.coefficients[:count]
    return {name: float(value) for name, value in zip(problem.prior.names, change, strict=True)}


def _sandwich(problem: Problem, fit: Fit) -> float:
    """Return the standard deviation of the last term's amplitude from the scatter of its day scores."""
    days = np.flatnonzero(problem.grams.fit)
    coefficients = np.concatenate([[1.0], fit.solution.coefficients])
    influence = fit.products[days][:, 1:, :] @ coefficients @ fit.solution.inverse[-1]
    plain = float(fit.deviations[-1])
    scatter = float(np.sqrt(np.sum((influence - influence.mean()) ** 2) * len(days) / max(len(days) - 1, 1)))
    return max(plain, scatter)


def _shape(problem: Problem, reduced: Fit, hypothesis: Hypothesis) -> dict[str, float]:
    """Return shape values, by a parabola through the gains of neighbouring shapes where there is one shape."""
    candidate = hypothesis.cause
    assert isinstance(candidate, Candidate)
    values = candidate.values
    if len(values) != 1:
        return values
    (name,) = values
    same = [
        (one.values[name], column)
        for one, column in zip(problem.candidates, problem.candidate, strict=True)
        if one.effect == candidate.effect
    ]
    same.sort()
    tried = np.array([value for value, _ in same])
    if len(tried) < 3 or name == "direction":
        return values
    gains = np.array(
        [
            search.fit(problem.grams, reduced.model.with_term(Term(column, hypothesis.term.onset))).solution.gain
            for _, column in same
        ]
    )
    best = int(np.clip(np.argmax(gains), 1, len(tried) - 2))
    x, y = tried[best - 1 : best + 2], gains[best - 1 : best + 2]
    curve = np.polyfit(x, y, 2)
    if curve[0] >= 0.0:
        return values
    return {name: float(np.clip(-0.5 * curve[1] / curve[0], tried[0], tried[-1]))}


def _onset(problem: Problem, reduced: Fit, hypothesis: Hypothesis) -> OnsetInterval | None:
    """Return the beginning and its 90 % interval: days whose profile likelihood lies within 1.35 of the best."""
    if hypothesis.term.onset is None:
        return None
    days = list(range(1, problem.split.days - 1))
    gains = np.array(
        [
            search.fit(
                problem.grams,
                reduced.model.with_term(Term(hypothesis.term.column, day, _ageing(problem, hypothesis))),
            ).solution.gain
            for day in days
        ]
    )
    best = selection.middle_of_best(gains)
    inside = np.flatnonzero(gains >= gains[best] - 1.353)
    return OnsetInterval(
        _day_start(problem, days[best]),
        _day_start(problem, days[int(inside[0])] - 1),
        _day_start(problem, days[int(inside[-1])] + 1),
    )


def _ageing(problem: Problem, hypothesis: Hypothesis) -> int | None:
    return problem.ageing[hypothesis.term.column - problem.candidate.start] if _ages(hypothesis) else None


def _ages(hypothesis: Hypothesis) -> bool:
    return isinstance(hypothesis.cause, Candidate) and hypothesis.cause.ages


def _day_start(problem: Problem, day: int) -> np.datetime64:
    rows = np.flatnonzero(problem.split.day == min(max(day, 0), problem.split.days - 1))
    time: np.datetime64 = problem.line.record.time[rows[0]]
    return time
