"""Which cause stands: the best ones compared, each beside its own noise, and against patterns without a name.

The noise of a log is fitted to what a model leaves. A cause that is not in the model stands in its noise: it widens
the scale, lengthens the colour, and has its own samples counted as outliers, so that in a search under that noise it
gains a third of what it could. Here each of the best causes gets the noise that is left beside it, and models
are compared by the full likelihood of Student's t (the profile likelihood: Barndorff-Nielsen and Cox 1994,
Inference and Asymptotics, ch. 3). A wrong name leaves structure: patterns in clock, calendar and weather that fit
better than it, or still fit much after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis import linear, noise, search
from igrow.trainer.diagnosis.candidates import Pattern
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.linear import RESIDUAL, DailyGrams, Fit, LinearModel, Term
from igrow.trainer.diagnosis.noise import Whitening
from igrow.trainer.diagnosis.search import Hypothesis


@dataclass(frozen=True)
class Profile:
    """A model at its likeliest coefficients and noise."""

    model: LinearModel
    amplitudes: tuple[float, ...]
    """Of the terms."""
    deviations: tuple[float, ...]
    """Their standard deviations."""
    whitening: Whitening
    by_day: Floats
    """Log-likelihood of every day, held-out ones too, (days,)."""
    penalty: float
    """Of the base, for standing away from its prior's mean."""


@dataclass(frozen=True)
class Contender:
    """A hypothesis beside the noise that it leaves."""

    hypothesis: Hypothesis
    """Its gain is that of the profile likelihood."""
    beyond_null: float
    """The gain that is left when its usual size in logs with nothing missing is allowed for, less an onset's price."""
    profile: Profile
    bootstrap_p: float
    """Probability that unseen days are not likelier with it."""


@dataclass(frozen=True)
class Round:
    """What one round of the search found, under the noise that is left beside it."""

    design: Design
    null: Fit
    """The model without a cause."""
    named: Fit
    """The model with the cause, or that without where there is none."""
    cause: Contender | None
    patterns: tuple[Hypothesis, ...]
    """What fits in place of a cause, where none explains what is there."""
    outdone_by: Hypothesis | None = None
    """A pattern that unseen days tell better than the cause."""


def compare(design: Design, explained: float, rng: np.random.Generator, *, causes: bool = True) -> Round:
    """Return the cause that stands in a design, or the patterns that no cause explains.

    Args:
        design: of the log, its known causes in the model.
        explained: log-likelihood that the causes found before, now part of the model, have gained.
        rng: for flips and bootstraps.
        causes: look for a cause, and not for patterns only.
    """
    rules = design.rules
    null = profile(design, design.null_model())
    cause = _best_cause(design, null, rng) if causes else None
    ranked = search.score_patterns(design, linear.fit(design.grams, null.model), pattern_onsets(design), rng)
    growth = _growth(design)
    smallest = growth * rules.gain_of_pattern(transferred=design.transferred)
    gained = cause.hypothesis.gain if cause else 0.0
    needed = max(smallest, rules.pattern_over_cause * gained, rules.pattern_over_found * explained)
    for one in contest(design, null, ranked, rng):
        least = rules.clock_factor * smallest if is_steady(one.hypothesis) else 0.0
        if one.bootstrap_p <= rules.largest_bootstrap_p and one.hypothesis.gain > max(needed, least):
            patterns = _patterns(design.whitened(one.profile.whitening), one, growth, rng)
            return _round(design, null, None, patterns)
    return _round(design, null, cause, ())


def profile(design: Design, model: LinearModel, start: Whitening | None = None) -> Profile:
    """Fit coefficients and noise of a model by turns to the fit days.

    Args:
        design: whose columns the model names.
        model: base and terms.
        start: noise to begin with (None: the design's).
    """
    day, days = design.line.runs.day, design.split.days
    stack = np.concatenate(
        [design.values[[RESIDUAL, *model.base]], *(search.column_of(design, one)[None] for one in model.terms)]
    )
    size = len(model.base)
    terms = tuple(Term(size + 1 + index) for index in range(len(model.terms)))
    own = LinearModel(tuple(range(1, size + 1)), model.precision, model.mean, terms)
    whitening = start or design.whitening
    for _ in range(design.rules.noise_rounds):
        products = linear.daily_products(whitening(stack), day, days)
        fitted = linear.fit(DailyGrams(products, design.split.fit), own)
        coefficients = fitted.solution.coefficients
        errors = np.tensordot(np.concatenate([[1.0], coefficients]), stack, axes=1)
        whitening = design.fit_noise(errors, whitening)
    likelihood = np.where(design.observed, noise.log_likelihood(whitening, errors), 0.0).sum(axis=1)
    by_day = np.zeros(days)
    np.add.at(by_day, day, likelihood)
    away = coefficients[:size] - model.mean
    penalty = 0.5 * float(away @ model.precision @ away)
    return Profile(
        model, tuple(fitted.amplitudes.tolist()), tuple(fitted.deviations.tolist()), whitening, by_day, penalty
    )


def gain(design: Design, full: Profile, null: Profile) -> float:
    """Return the penalised log-likelihood that a model has over another on the fit days."""
    days = (full.by_day - null.by_day)[design.split.fit]
    return float(days.sum()) - full.penalty + null.penalty


def bootstrap_p(design: Design, full: Profile, null: Profile, rng: np.random.Generator) -> float:
    """Return the bootstrap probability that unseen days are not likelier under a model than under another."""
    days = (full.by_day - null.by_day)[~design.split.fit]
    if not len(days):
        return 0.0
    means = days[rng.integers(0, len(days), size=(design.rules.bootstrap_draws, len(days)))].mean(axis=1)
    return float(np.mean(means <= 0.0))


def contest(design: Design, null: Profile, ranked: Sequence[Hypothesis], rng: np.random.Generator) -> list[Contender]:
    """Return the first of `ranked` that pass the test, each beside its own noise, the likeliest first."""
    rules = design.rules
    passed = [one for one in ranked if one.p_value <= rules.largest_p_value]
    contenders = []
    for one in passed[: rules.contenders]:
        own = profile(design, null.model.with_term(one.term), null.whitening)
        gained = gain(design, own, null)
        price = 0.0 if one.term.onset is None else rules.onset_price
        # With a normal prior of the usual size on the amplitude, so much of the gain is beyond the usual.
        beyond = 1.0 / (1.0 + (design.null_amplitude.get(one.effect, 0.0) / own.deviations[-1]) ** 2)
        unseen = bootstrap_p(design, own, null, rng)
        contenders.append(Contender(replace(one, gain=gained - price), gained * beyond - price, own, unseen))
    return sorted(contenders, key=lambda one: -one.hypothesis.gain)


def _best_cause(design: Design, null: Profile, rng: np.random.Generator) -> Contender | None:
    """Return the best cause of a log, within its bounds; None where none gains what is needed."""
    ranked = search.score_candidates(design, linear.fit(design.grams, null.model), search.onset_days(design), rng)
    for one in contest(design, null, ranked, rng):
        if _suffices(design, one) and is_within_bounds(design, one):
            return one
    return None


def _suffices(design: Design, contender: Contender) -> bool:
    """Tell whether a cause gains more than chance does and, where errors count by hours, than a wrong structure."""
    rules = design.rules
    needed = rules.gain_of_cause(time_steps=design.time_steps, transferred=design.transferred)
    usual = not design.time_steps and contender.beyond_null < rules.least_gain_beyond_null
    return contender.hypothesis.gain >= needed and not usual


def is_within_bounds(design: Design, contender: Contender) -> bool:
    """Tell whether a cause lies within its bounds, or about at one."""
    one, beyond = contender.hypothesis, design.rules.beyond_bound
    low, high = design.amplitude_bounds(one.effect, one.term.onset)
    (amplitude,) = contender.profile.amplitudes
    return beyond * low <= amplitude <= beyond * high and (low < 0.0 or amplitude > 0.0)


def _round(design: Design, null: Profile, cause: Contender | None, patterns: tuple[Hypothesis, ...]) -> Round:
    """Return both models under the noise that is left beside the cause."""
    if cause is None:
        fit = linear.fit(design.grams, null.model)
        return Round(design, fit, fit, None, patterns)
    seen = design.whitened(cause.profile.whitening)
    return Round(seen, linear.fit(seen.grams, null.model), linear.fit(seen.grams, cause.profile.model), cause, patterns)


def _growth(design: Design) -> float:
    """Return how many times as much as in `fitted_days` patterns gain from a wrong structure: the same every day.

    Where the structure is right (errors count time step by time step), nothing grows.
    """
    # The first local day is seldom a whole one.
    return 1.0 if design.time_steps else max(1.0, (design.split.days - 1) / design.rules.fitted_days)


def pattern_onsets(design: Design) -> list[int | None]:
    """Return the days of beginning that are tried for patterns."""
    return search.onset_days(design)[:: design.rules.pattern_onset_stride]


def is_steady(one: Hypothesis) -> bool:
    """Tell whether a pattern is of the clock alone: a wrong model looks like one that is always there."""
    return isinstance(one.cause, Pattern) and not set(one.cause.drivers) - {"time"}


def _patterns(design: Design, first: Contender, growth: float, rng: np.random.Generator) -> tuple[Hypothesis, ...]:
    """Return the first pattern and further ones, each significant beside those before it."""
    rules = design.rules
    found = [first.hypothesis]
    current = linear.fit(design.grams, first.profile.model)
    before = len(current.model.terms) - 1
    while len(found) < rules.most_patterns:
        ranked = search.score_patterns(design, current, pattern_onsets(design), rng)
        passed = [
            one
            for one in ranked
            if one.p_value <= rules.largest_p_value
            and one.gain
            >= rules.pattern_further_gain * growth * (rules.further_clock_factor if is_steady(one) else 1.0)
        ]
        if not passed:
            break
        found.append(passed[0])
        current = linear.fit(design.grams, current.model.with_term(passed[0].term))
    amplitudes = current.amplitudes[before:]
    return tuple(replace(one, amplitude=float(amplitude)) for one, amplitude in zip(found, amplitudes, strict=True))
