"""What has changed in a greenhouse since its calibration: the cause that stands, or patterns that no cause explains.

Every effect and every pattern is scored against what the history of this very greenhouse leads to expect. A beginning
has a price, and is judged by the days before it. What a hypothesis gained in windows of the calibration log, where
nothing had changed, is taken off its gain, so that the bound is this greenhouse's own; and the scatter of its day
scores must bear out a part of what the noise says, or a few odd days would speak for all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Fit, LinearModel
from igrow.trainer.diagnosis.learned.null_gains import BEGINNING_PREFIX, NullGains
from igrow.trainer.diagnosis.search import scan
from igrow.trainer.diagnosis.search.scan import Hypothesis


@dataclass(frozen=True)
class Round:
    """What one round of the search found, under the noise that is left beside it."""

    design: Design
    null: Fit
    """The model without a cause."""
    named: Fit
    """The model with the cause, or that without where there is none."""
    cause: Hypothesis | None
    patterns: tuple[Hypothesis, ...]
    """What fits in place of a cause, where none explains what is there."""
    outdone_by: Hypothesis | None = None
    """A pattern that unseen days tell better than the cause."""


def changed(
    design: Design, explained: float, rng: np.random.Generator, *, causes: bool = True, patterns: bool = True
) -> Round:
    """Return the change that stands in a log, or the patterns that no cause explains.

    Args:
        design: of the log, with its greenhouse's history.
        explained: gain of the changes found before, now part of the model.
        rng: for flips and bootstraps.
        causes: look for a cause.
        patterns: look for patterns.
    """
    rules, null = design.rules, linear.fit(design.grams, design.null_model())
    onsets = scan.onset_days(design)
    cause = chosen(design, scored(design, null, rng)) if causes else None
    times = onsets[:: rules.pattern_onset_stride]
    pattern = best(design, scan.score_patterns(design, null, times, rng)) if patterns else None
    nothing = Round(design, null, null, None, ())
    if pattern is not None:
        gained = 0.0 if cause is None else net_gain(design, cause)
        needed = max(rules.least_pattern_change, rules.pattern_over_change * gained, explained)
        if net_gain(design, pattern) >= needed and proven_gain(design, pattern) >= rules.least_proven_pattern:
            return replace(nothing, patterns=(pattern,))
    if cause is None or over_null(design, cause) < 1.0:
        return nothing
    left = max(rules.least_left_by_hour, rules.left_by_hour_share * net_gain(design, cause))
    if pattern is not None and left_by_hour(design, null, cause, rng) >= left:
        return replace(nothing, patterns=(pattern,))
    return round_of(design, null, cause)


def scored(design: Design, null: Fit, rng: np.random.Generator) -> list[Hypothesis]:
    """Return the best hypothesis of every effect, with what the same gains there all the time.

    Beside what is unexplained a process that is there all the time may be a part of it: it is none.
    """
    found = scan.score_candidates(design, null, scan.onset_days(design), rng)
    always = {one.effect: one.gain for one in scan.score_candidates(design, null, [None], rng)}
    found = [one if one.term.onset is None else replace(one, always=always.get(one.effect, 0.0)) for one in found]
    alone = not design.known.unnamed
    return [one for one in found if alone or one.always is not None or EFFECTS[one.effect].kind == "sensor"]


def chosen(design: Design, found: list[Hypothesis]) -> Hypothesis | None:
    """Return the hypothesis with the largest net gain.

    Where that gains less than it must, another may gain about as much and more than it must. And what a calibration
    misses in another season gains much all along, and hides nothing that begins within the log.
    """
    first = best(design, found)
    if first is None or over_null(design, first) >= 1.0:
        return first
    gain = net_gain(design, first)
    near = [one for one in found if net_gain(design, one) >= gain - design.rules.confounded_within(gain)]
    sure = best(design, [one for one in near if over_null(design, one) >= 1.0])
    return sure or best(design, [one for one in found if begun_over_null(design, one) >= 1.0]) or first


def left_by_hour(design: Design, null: Fit, cause: Hypothesis, rng: np.random.Generator) -> float:
    """Return what a pattern by the hour still gains beside a cause.

    A cause that is not the true one leaves hours of the day at which it is wrong; what weather leaves, greenhouses in
    which nothing has changed leave as well.
    """
    named = linear.fit(design.grams, null.model.with_term(cause.term))
    left = scan.score_patterns(design, named, [None], rng)
    by_hour = (one for one in left if isinstance(one.cause, Pattern) and "hour" in one.cause.drivers)
    return max((proven_gain(design, one) for one in by_hour), default=0.0)


def best(design: Design, scored: list[Hypothesis]) -> Hypothesis | None:
    """Return the hypothesis with the largest net gain, None for none."""
    known = design.known.without
    return max((one for one in scored if one.effect not in known), key=lambda one: net_gain(design, one), default=None)


def net_gain(design: Design, one: Hypothesis) -> float:
    """Return the gain over what the hypothesis gained where nothing had changed.

    That is learned of weeks with each other. Where it begins within the log its first days tell what was there before:
    the gain over the same effect there all the time counts, if that is more.
    """
    return one.gain - min(_own_gain(design, one), np.inf if one.always is None else one.always)


def proven_gain(design: Design, one: Hypothesis) -> float:
    """Return the gain over what it gained where nothing had changed, as far as the scatter of days bears it out."""
    return _proven(design, one, _own_gain(design, one))


def proven_begun_gain(design: Design, one: Hypothesis) -> float:
    """Return the same over what the effect gains there all the time; 0 where it does not begin within the log."""
    return 0.0 if one.always is None else _proven(design, one, one.always)


def over_null(design: Design, one: Hypothesis) -> float:
    """Return what an effect surely gains, over what it must."""
    return max(proven_gain(design, one) / _null_gains(design).needed(one.effect), begun_over_null(design, one))


def begun_over_null(design: Design, one: Hypothesis) -> float:
    """Return the same of its beginning within the log."""
    return proven_begun_gain(design, one) / _null_gains(design).needed(BEGINNING_PREFIX + one.effect)


def _null_gains(design: Design) -> NullGains:
    known = design.known.null_gains
    assert known is not None
    return known


def _own_gain(design: Design, one: Hypothesis) -> float:
    return design.known.own_gains.get(one.key, 0.0)


def _proven(design: Design, one: Hypothesis, without: float) -> float:
    """Return a gain less another, or its geometric mean with the same by the scatter of day scores where that is less.

    Alone the scatter says too little of what comes on few days: a drizzle, a cold night.
    """
    price = 0.0 if one.term.onset is None else design.rules.onset_price
    by_noise, by_days = one.gain - without, 0.5 * one.statistic**2 - price - without
    if by_days >= by_noise or by_days <= 0.0:
        return min(by_noise, by_days)
    return math.sqrt(by_noise * by_days)


def round_of(design: Design, null: Fit, cause: Hypothesis) -> Round:
    """Return both models under the noise that is left beside the cause: its scale and weights, not its colour."""
    model = null.model.with_term(cause.term)
    seen = beside(design, model)
    return Round(seen, linear.fit(seen.grams, null.model), linear.fit(seen.grams, model), cause, ())


def beside(design: Design, model: LinearModel) -> Design:
    """Return a design under the noise that a model leaves."""
    fitted = linear.fit(design.grams, model)
    coefficients = fitted.solution.coefficients[: len(model.base)]
    errors = design.values[0] + np.tensordot(coefficients, design.values[list(model.base)], axes=1)
    for amplitude, term in zip(fitted.amplitudes, model.terms, strict=True):
        errors = errors + amplitude * scan.column_of(design, term)
    return design.whitened(design.fit_noise(errors))
