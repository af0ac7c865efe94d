"""A change that time steps alone do not prove: told by days that no fit has seen, a day ahead.

What a calibration carries into another season can look like a sensor that is off, or like what a crop transpires at
night, as strongly as such a change itself. The errors of free runs of a day tell these apart. In the linear model that
the search has made, all changes are fitted to some days, beside everything else, and judged on the others, each day
held out in turn (Stone 1974, J. R. Stat. Soc. B 36, 111-147). What is known of everything else is asked twice: what the
history of the greenhouse leads to expect, and parameters that move as physics lets. Neither is quite so, and what only
one of them bears out is often no change: both count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats
from igrow.trainer.data.splits import folds
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import DailyGrams, LinearModel
from igrow.trainer.diagnosis.learned.null_gains import read_null_skills
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import change, scan
from igrow.trainer.diagnosis.search.change import Round
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import CORRELATION_TIME

_EXPLAINED = 1e-6
"""Share of a column's square below which everything else explains it altogether."""


@dataclass(frozen=True)
class CrossValidated:
    """A hypothesis, and what it takes off the squared errors of days that were held out."""

    hypothesis: Hypothesis
    falls: Floats
    """By history and by physics, on each day, over the squared error of all days, mean over quantities, (2, days)."""

    @property
    def skill(self) -> float:
        """Share of the squared error that goes: the geometric mean by history and by physics, or the lesser below 0."""
        return float(_skill(self.falls))

    def p_value(self, rules: DecisionRules, rng: np.random.Generator) -> float:
        """Return the share of bootstrap draws of days in which it makes them no better."""
        return float(np.mean(_drawn([self], rules, rng) <= 0.0))


def find(design: Design, by_physics: Gaussian, rng: np.random.Generator) -> Round | None:
    """Return the round in which unseen days name a change; None where none makes them better by enough.

    Args:
        design: of the log, with its greenhouse's history.
        by_physics: where the parameters may lie if they have changed as physics alone lets expect.
        rng: for flips and bootstraps.
    """
    null = linear.fit(design.grams, design.null_model())
    found = best(cross_validated(design, by_physics, promising(design, rng)))
    if found is None or found.skill < read_null_skills().needed(found.hypothesis.effect, design.rules.days_over_null):
        return None
    return change.round_of(design, null, found.hypothesis)


def best(found: Sequence[CrossValidated]) -> CrossValidated | None:
    """Return the hypothesis that takes most off unseen days; None for none."""
    return max(found, key=lambda one: one.skill, default=None)


def settled(design: Design, by_physics: Gaussian, told: Round, rng: np.random.Generator) -> Round:
    """Return a round whose cause unseen days tell as well, or one without a cause.

    Where another that gains about as much surely makes unseen days better than it does, that is the cause if it gains
    what it must, or makes unseen days better by as much as one must that these alone tell. What gains little more than
    it must is no cause where unseen days show no more of it than where nothing has changed.

    Args:
        design: of the log, with its greenhouse's history.
        by_physics: where the parameters may lie if they have changed as physics alone lets expect.
        told: a round with a cause.
        rng: for flips and bootstraps.
    """
    assert told.cause is not None
    rules, null, known = design.rules, linear.fit(design.grams, design.null_model()), read_null_skills()
    nothing, first = Round(design, null, null, None, ()), told.cause
    scored = change.scored(design, null, rng)
    own, *others = cross_validated(design, by_physics, [first, *rivals(design, first, scored)])
    rival = best(others)
    # What makes days worse that no fit saw is no rival.
    if rival is not None and rival.skill > max(own.skill, 0.0) and _is_surely_better(rival, own, rules, rng):
        own = rival
    chosen, begun = own.hypothesis, own.hypothesis.term.onset is not None
    over_null = change.over_null(design, chosen)
    by_days_alone = known.needed(chosen.effect, rules.days_over_null)
    if over_null < 1.0:
        return nothing if begun or own.skill < by_days_alone else change.round_of(design, null, chosen)
    # A beginning was searched for among all days.
    least = by_days_alone if begun else known.largest.get(chosen.effect, 0.0)
    if over_null < rules.far_over_null and own.skill < least:
        return nothing
    return told if chosen is first else change.round_of(design, null, chosen)


def with_what_outdoes_it(design: Design, by_physics: Gaussian, told: Round, rng: np.random.Generator) -> Round:
    """Return a round with a cause, and with the pattern, if there is one, that surely makes unseen days better by more.

    What the catalogue does not hold borrows the name that comes nearest. That something has changed a name shows that
    stands; a pattern that gains about as much and makes unseen days better by half as much again says better what.
    Where steps tell a name by far, days hardly say more: no law is quite the plant's, and a pattern may be off by less.

    Arguments are as of `settled`.
    """
    assert told.cause is not None
    rules, first = design.rules, told.cause
    if change.over_null(design, first) >= rules.far_over_null:
        return told
    scored = scan.score_patterns(design, linear.fit(design.grams, design.null_model()), [None], rng)
    own, *others = cross_validated(design, by_physics, [first, *rivals(design, first, scored)])
    rival = best(others)
    needed = max(own.skill + rules.least_skill, rules.pattern_over_skill * own.skill)
    if rival is None or rival.skill < needed or not _is_surely_better(rival, own, rules, rng):
        return told
    return replace(told, outdone_by=rival.hypothesis)


def clearest(design: Design, by_physics: Gaussian, told: Round, rng: np.random.Generator) -> Round:
    """Return a round with that pattern which makes unseen days best, among those that gain about as much as its own.

    Arguments are as of `settled`, of a round with a pattern.
    """
    (first,) = told.patterns
    null, onsets = linear.fit(design.grams, design.null_model()), scan.onset_days(design)
    scored = scan.score_patterns(design, null, onsets[:: design.rules.pattern_onset_stride], rng)
    chosen = best(cross_validated(design, by_physics, [first, *rivals(design, first, scored)]))
    return told if chosen is None else replace(told, patterns=(chosen.hypothesis,))


def rivals(design: Design, first: Hypothesis, scored: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the other hypotheses that gain nearly as much as the first, or more, and may be told.

    Args:
        design: of the log, with its greenhouse's history.
        first: an effect or a pattern.
        scored: effects or patterns, each with its beginning.
    """
    gain = change.net_gain(design, first)
    least = gain - design.rules.confounded_within(gain)
    asked = (one for one in scored if one.key != first.key and one.effect not in design.known.without)
    return [one for one in asked if change.net_gain(design, one) >= least]


def promising(design: Design, rng: np.random.Generator) -> list[Hypothesis]:
    """Return the effects that gain enough to be asked of unseen days, as if they had been there all the time."""
    null = linear.fit(design.grams, design.null_model())
    scored = scan.score_candidates(design, null, [None], rng)
    asked = (one for one in scored if one.effect not in design.known.without)
    return [one for one in asked if change.net_gain(design, one) >= design.rules.least_unproven_change]


def cross_validated(design: Design, by_physics: Gaussian, hypotheses: Sequence[Hypothesis]) -> list[CrossValidated]:
    """Return hypotheses with what each takes off every day, by fits to other days.

    Args:
        design: of the log, with its greenhouse's history.
        by_physics: where the parameters may lie if they have changed as physics alone lets expect.
        hypotheses: each beside everything else, but not beside the others.
    """
    if not hypotheses:
        return []
    assert design.prior.names == by_physics.names
    # Where the model is linear about: the prior is where the parameters are expected.
    stand = design.prior.mean - design.known.amplitudes.mean[: len(by_physics.names)]
    columns = np.array([scan.column_of(design, one.term) for one in hypotheses])
    limits = np.array([_reach(design, one) for one in hypotheses])
    joint = design.null_model()
    held = design.block("parameter").columns
    errors = design.values[0]
    falls = [
        _falls(design, errors, design.values[list(joint.base)], joint, columns, limits),
        _falls(
            design,
            errors - design.known.misfit,
            design.values[held.start : held.stop],
            LinearModel(tuple(held), by_physics.precision, by_physics.mean - stand),
            columns,
            limits,
        ),
    ]
    return [CrossValidated(one, fall) for one, fall in zip(hypotheses, np.stack(falls, axis=1), strict=True)]


def _reach(design: Design, one: Hypothesis) -> tuple[float, float]:
    """Return the least and the largest amplitude of an effect or a pattern."""
    if isinstance(one.cause, Pattern):
        return -design.rules.largest_pattern, design.rules.largest_pattern
    return design.amplitude_bounds(one.effect, one.term.onset)


def _falls(
    design: Design, errors: Floats, others: Floats, known: LinearModel, columns: Floats, limits: Floats
) -> Floats:
    """Return what columns take off the squared errors of days that are held out, as `CrossValidated.falls`, (c, days).

    Args:
        design: of the log: its days and runs.
        errors: (b, r, steps).
        others: columns of everything else, (p, b, r, steps).
        known: of their coefficients.
        columns: to be judged, each beside `others`, (c, b, r, steps).
        limits: least and largest amplitude of each, (c, 2).
    """
    day, count, split = design.line.runs.day, len(others), design.split
    # Every quantity counts by its own error; errors within a correlation time count once.
    scale = np.sqrt(np.mean(errors**2, axis=(1, 2), keepdims=True) + 1e-300)
    everything = np.concatenate([errors[None], others, columns]) / scale
    weight = design.line.record.step / CORRELATION_TIME
    products = weight * linear.daily_products(everything, day, split.days)
    base = LinearModel(tuple(range(1, count + 1)), known.precision, known.mean)
    before, after = np.zeros((len(errors), split.days)), np.zeros((len(columns), len(errors), split.days))
    for fold in folds(split):
        fitted = linear.fit(DailyGrams(products, fold.fit), base).solution
        total = products[fold.fit].sum(axis=0)
        # What is left of every column when everything else has followed it.
        own, along = np.diag(total)[count + 1 :], total[count + 1 :, : count + 1]
        follow = along[:, 1:] @ fitted.inverse
        curvature = own - np.sum(follow * along[:, 1:], axis=1)
        score = along @ np.append(1.0, fitted.coefficients)
        seen = curvature > _EXPLAINED * np.maximum(own, 1e-300)
        amplitudes = np.where(seen, np.clip(-score / np.where(seen, curvature, 1.0), *limits.T), 0.0)
        runs = ~fold.fit[day]
        held = everything[:, :, runs]
        left = held[0] + np.tensordot(fitted.coefficients, held[1 : count + 1], axes=1)
        changed = held[count + 1 :] - np.tensordot(follow, held[1 : count + 1], axes=1)
        with_each = left + amplitudes[:, None, None, None] * changed
        for place, one in enumerate(day[runs]):
            before[:, one] += np.sum(left[:, place] ** 2, axis=-1)
            after[:, :, one] += np.sum(with_each[:, :, place] ** 2, axis=-1)
    whole = np.maximum(before.sum(axis=-1, keepdims=True), 1e-300)
    falls: Floats = np.mean((before - after) / whole, axis=1)
    return falls


def _is_surely_better(
    one: CrossValidated, other: CrossValidated, rules: DecisionRules, rng: np.random.Generator
) -> bool:
    one_drawn, other_drawn = _drawn([one, other], rules, rng)
    return bool(np.mean(one_drawn > other_drawn) >= rules.confidence)


def _drawn(found: Sequence[CrossValidated], rules: DecisionRules, rng: np.random.Generator) -> Floats:
    """Return the skills of hypotheses on bootstrap draws of days, the same days for all, (h, draws)."""
    count = found[0].falls.shape[-1]
    days = rng.integers(0, count, size=(rules.bootstrap_draws, count))
    return np.stack([_skill(one.falls[:, days]) for one in found])


def _skill(falls: Floats) -> Floats:
    """Return the skill of falls by history and by physics, (2, ..., days) -> (...)."""
    lesser, larger = np.sort(falls.sum(axis=-1), axis=0)
    skill: Floats = np.where(lesser > 0.0, np.sqrt(np.maximum(lesser, 0.0) * np.maximum(larger, 0.0)), lesser)
    return skill
