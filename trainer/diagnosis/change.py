"""What has changed in a greenhouse since its calibration: the cause that stands, or patterns that no cause explains.

Every effect and every pattern is scored against what the history of this very greenhouse leads to expect. A beginning
has a price. What a hypothesis gained in windows of the calibration log, where nothing had changed, is taken off its
gain, so that the bound is this greenhouse's own; and the scatter of its day scores must bear out a part of what the
noise says, or a few odd days would speak for all.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from igrow.trainer.diagnosis import linear, search
from igrow.trainer.diagnosis.candidates import Pattern
from igrow.trainer.diagnosis.compare import Contender, Profile, Round, bootstrap_p
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.linear import Fit
from igrow.trainer.diagnosis.search import Hypothesis


def changed(design: Design, explained: float, rng: np.random.Generator, *, causes: bool = True) -> Round:
    """Return the change that stands in a log, or the patterns that no cause explains.

    Args:
        design: of the log, with its greenhouse's history.
        explained: gain of the changes found before, now part of the model.
        rng: for flips and bootstraps.
        causes: look for a cause, and not for patterns only.
    """
    rules, null = design.rules, linear.fit(design.grams, design.null_model())
    onsets = search.onset_days(design)
    cause = best(design, search.score_candidates(design, null, onsets, rng)) if causes else None
    pattern = best(design, search.score_patterns(design, null, onsets[:: rules.pattern_onset_stride], rng))
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
    return round_of(design, null, cause, rng)


def left_by_hour(design: Design, null: Fit, cause: Hypothesis, rng: np.random.Generator) -> float:
    """Return what a pattern by the hour still gains beside a cause.

    A cause that is not the true one leaves hours of the day at which it is wrong; what weather leaves, greenhouses in
    which nothing has changed leave as well.
    """
    named = linear.fit(design.grams, null.model.with_term(cause.term))
    left = search.score_patterns(design, named, [None], rng)
    by_hour = (one for one in left if isinstance(one.cause, Pattern) and "hour" in one.cause.drivers)
    return max((proven_gain(design, one) for one in by_hour), default=0.0)


def best(design: Design, scored: list[Hypothesis]) -> Hypothesis | None:
    """Return the hypothesis with the largest net gain, None for none."""
    known = design.history.without if design.history is not None else frozenset()
    return max((one for one in scored if one.effect not in known), key=lambda one: net_gain(design, one), default=None)


def net_gain(design: Design, one: Hypothesis) -> float:
    """Return the gain over what the hypothesis gained where nothing had changed."""
    assert design.history is not None
    return one.gain - design.history.own_gains.get(one.key, 0.0)


def proven_gain(design: Design, one: Hypothesis) -> float:
    """Return the net gain, or its geometric mean with the same by the scatter of day scores where that is less.

    Alone the scatter says too little of what comes on few days: a drizzle, a cold night.
    """
    price = 0.0 if one.term.onset is None else design.onset_price
    by_noise = net_gain(design, one)
    by_days = net_gain(design, replace(one, gain=0.5 * one.statistic**2 - price))
    if by_days >= by_noise or by_days <= 0.0:
        return min(by_noise, by_days)
    return math.sqrt(by_noise * by_days)


def over_null(design: Design, one: Hypothesis) -> float:
    """Return what an effect surely gains, over what it must; 0 where no history tells what that is."""
    if design.history is None or design.history.null_gains is None:
        return 0.0
    return proven_gain(design, one) / design.history.null_gains.needed(one.effect)


def round_of(design: Design, null: Fit, cause: Hypothesis, rng: np.random.Generator) -> Round:
    """Return both models under the noise that is left beside the cause: its scale and weights, not its colour."""
    model = null.model.with_term(cause.term)
    named = linear.fit(design.grams, model)
    errors = design.values[0] + np.tensordot(
        named.solution.coefficients[: len(model.base)], design.values[list(model.base)], axes=1
    )
    errors = errors + named.amplitudes[0] * search.column_of(design, cause.term)
    seen = design.whitened(design.fit_noise(errors))
    null, named = linear.fit(seen.grams, null.model), linear.fit(seen.grams, model)
    without, full = (_profile(seen, one) for one in (null, named))
    contender = Contender(cause, net_gain(design, cause), full, bootstrap_p(seen, full, without, rng))
    return Round(seen, null, named, contender, ())


def _profile(design: Design, fit: Fit) -> Profile:
    amplitudes, deviations = tuple(fit.amplitudes.tolist()), tuple(fit.deviations.tolist())
    return Profile(fit.model, amplitudes, deviations, design.whitening, -fit.day_losses, 0.0)
