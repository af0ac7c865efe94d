"""Size, interval, beginning and confounded causes of the cause that a round found."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2, norm

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Candidate
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Fit, Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import change, scan
from igrow.trainer.diagnosis.search.change import Round
from igrow.trainer.diagnosis.search.refit import Refitted
from igrow.trainer.diagnosis.search.scan import Hypothesis


@dataclass(frozen=True)
class OnsetInterval:
    """When something began, UTC, with its confidence interval."""

    time: np.datetime64
    low: np.datetime64
    high: np.datetime64

    @property
    def noon(self) -> np.datetime64:
        """Noon of the day it began on, which tells its date: solar midnight may be on the day before by the clock."""
        return self.time + np.timedelta64(12, "h")


@dataclass(frozen=True)
class Estimated:
    """A cause with everything that is known of it."""

    hypothesis: Hypothesis
    term: ActiveTerm
    amplitude: Estimate
    gain: float
    """Log-likelihood that it adds to the model it was found in."""
    onset: OnsetInterval | None
    confounded: tuple[str, ...]
    """Effects that would do as well in its place, itself first."""
    shift: dict[str, float] = field(default_factory=dict)
    """How the parameters move when it comes in."""
    shapes: dict[str, Estimate] = field(default_factory=dict)
    regimes: dict[str, Estimate] = field(default_factory=dict)
    effect_to_noise: float = 0.0
    skill: float = 0.0
    """Share of the squared error on unseen days that it removes."""
    change_skill: float = 0.0
    """The same of a change, where parameters change as physics alone lets expect."""
    over_null: float = 0.0
    """Gain of a change over what it must gain: more than it did wherever nothing had changed."""
    certainty: float = math.inf
    """Amplitude over its standard error, refitted beside all other causes; infinite before."""
    outdone_by: Hypothesis | None = None
    """A pattern that unseen days tell better."""

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.hypothesis.effect


def estimate(found: Round, rng: np.random.Generator) -> Estimated | None:
    """Return the cause that a round found, if it did."""
    if found.cause is None:
        return None
    design, null, hypothesis = found.design, found.null, found.cause
    gain = found.named.solution.gain - null.solution.gain
    (amplitude,) = found.named.amplitudes.tolist()
    wide = reach(design.rules) * linear.deviation_by_day(design.grams, found.named)
    onset = onset_interval(design, null, hypothesis.term)
    shape = _shape(design, null, hypothesis)
    count = len(design.block("parameter"))
    shift = found.named.solution.coefficients[:count] - null.solution.coefficients[:count]
    return Estimated(
        hypothesis,
        ActiveTerm(hypothesis.effect, amplitude, shape, None if onset is None else onset.time),
        Estimate.about(amplitude, wide, EFFECTS[hypothesis.effect].amplitude.unit),
        hypothesis.gain,
        onset,
        _confounded(design, null, hypothesis, gain, rng),
        dict(zip(design.prior.names, shift.tolist(), strict=True)),
        over_null=change.over_null(design, hypothesis),
        outdone_by=found.outdone_by,
    )


def with_refitted(one: Estimated, refitted: Refitted, rules: DecisionRules) -> Estimated:
    """Return the cause with refitted values and their intervals."""
    definition = EFFECTS[one.effect]
    errors, amplitude = reach(rules), refitted.term.amplitude
    shapes = {}
    for shape in definition.shapes:
        value = refitted.term.shape[shape.name]
        wide = errors * refitted.shape_deviation[shape.name]
        shapes[shape.name] = Estimate(value, max(value - wide, shape.low), min(value + wide, shape.high), shape.unit)
    form = rules.form_deviation * amplitude
    wide = normal_quantile(rules) * float(np.hypot(rules.deviation_inflation * refitted.deviation, form))
    unit = definition.amplitude.unit
    regimes = {name: Estimate.about(value, errors * own, unit) for name, (value, own) in refitted.regimes.items()}
    interval = Estimate.about(amplitude, wide, unit)
    certainty = abs(amplitude) / refitted.deviation
    return replace(one, term=refitted.term, amplitude=interval, shapes=shapes, regimes=regimes, certainty=certainty)


def within_bounds(one: Estimated, design: Design) -> Estimated:
    """Return the cause with its size brought to the nearest bound, if it lies beyond."""
    size = float(np.clip(one.term.amplitude, *design.amplitude_bounds(one.effect, one.hypothesis.term.onset)))
    interval = replace(one.amplitude, value=size, low=min(one.amplitude.low, size), high=max(one.amplitude.high, size))
    return replace(one, term=replace(one.term, amplitude=size), amplitude=interval)


def from_before(one: Estimated, start: np.datetime64) -> Estimated:
    """Return a cause as a later log sees it: there from its first day on.

    Args:
        one: as the weeks before have told it.
        start: of these weeks, since when a sensor drifts that has drifted in all of them.
    """
    always = replace(one.hypothesis, term=replace(one.hypothesis.term, onset=None, ageing=None))
    ages = "elapsed_days" in EFFECTS[one.effect].drivers
    onset = start if ages and one.term.onset is None else one.term.onset
    return replace(one, hypothesis=always, term=replace(one.term, onset=onset))


def normal_quantile(rules: DecisionRules) -> float:
    """Return how many standard errors an interval reaches to either side."""
    return float(norm.ppf(0.5 + 0.5 * rules.confidence))


def reach(rules: DecisionRules) -> float:
    """Return how many standard errors of a linear fit an interval reaches to either side: they are too small."""
    return normal_quantile(rules) * rules.deviation_inflation


def _confounded(
    design: Design, null: Fit, hypothesis: Hypothesis, gain: float, rng: np.random.Generator
) -> tuple[str, ...]:
    """Return the effects that would do as well in the place of a cause of this gain, itself first.

    Of a cause that only unseen days tell, what gains too little to be asked of them is as good by nothing.
    """
    least = max(gain - design.rules.confounded_within(gain), design.rules.least_unproven_change)
    onsets = scan.onset_days(design) if hypothesis.term.onset is not None else [None]
    scored = scan.score_candidates(design, null, onsets, rng)
    hidden = design.known.without
    as_good = [one.effect for one in scored if one.gain >= least and one.effect not in hidden]
    return (hypothesis.effect, *(name for name in as_good if name != hypothesis.effect))


def _shape(design: Design, null: Fit, hypothesis: Hypothesis) -> dict[str, float]:
    """Return nonlinear parameters, by a parabola through the gains of neighbouring values where there is one."""
    candidate = hypothesis.cause
    assert isinstance(candidate, Candidate)
    values = candidate.values
    if len(values) != 1:
        return values
    (name,) = values
    columns = design.columns(f"effect:{candidate.effect}")
    first = design.block("effect").columns[0]
    same = sorted((design.candidates[column - first].values[name], column) for column in columns)
    tried = np.array([value for value, _ in same])
    if len(tried) < 3 or name == "direction":
        return values
    gains = np.array([_gain(design, null, Term(column, hypothesis.term.onset)) for _, column in same])
    best = int(np.clip(np.argmax(gains), 1, len(tried) - 2))
    curve = np.polyfit(tried[best - 1 : best + 2], gains[best - 1 : best + 2], 2)
    if curve[0] >= 0.0:
        return values
    return {name: float(np.clip(-0.5 * curve[1] / curve[0], tried[0], tried[-1]))}


def onset_interval(design: Design, null: Fit, term: Term) -> OnsetInterval | None:
    """Return the beginning and its interval: days whose profile likelihood lies near the best (Wilks' theorem)."""
    if term.onset is None:
        return None
    days = list(range(1, design.split.days - 1))
    gains = np.array([_gain(design, null, Term(term.column, day, term.ageing)) for day in days])
    best = scan.middle_of_best(gains)
    inside = np.flatnonzero(gains >= gains[best] - 0.5 * float(chi2.ppf(design.rules.confidence, 1)))
    return OnsetInterval(
        _day_start(design, days[best]),
        _day_start(design, days[int(inside[0])] - 1),
        _day_start(design, days[int(inside[-1])] + 1),
    )


def _gain(design: Design, null: Fit, term: Term) -> float:
    return linear.fit(design.grams, null.model.with_term(term)).solution.gain


def _day_start(design: Design, day: int) -> np.datetime64:
    first = np.flatnonzero(design.split.day == min(max(day, 0), design.split.days - 1))[0]
    time: np.datetime64 = design.line.record.time[first]
    return time
