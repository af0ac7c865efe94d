"""The search: which candidate, from which day on, explains most of the innovations, and how surely.

Every column is scored against the residual after the null (and what has been accepted before) has taken its share
under its priors. The score of a day is one number; under the hypothesis that nothing is missing its
sign is a coin's. Flipping the signs of whole days and taking the largest statistic over all columns and all
beginnings gives the price of having searched (max-T: Westfall and Young 1993, Resampling-Based Multiple Testing;
day scores centred at each column's own fit, as in a wild bootstrap: Liu 1988, Ann. Statist. 16).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import RESIDUAL, DailyGrams, Fit, Term
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX

_EXPLAINED = 1e-6
"""Share of a column's curvature below which the null explains it altogether."""
_UNBOUNDED = 1e9


@dataclass(frozen=True)
class Scan:
    """Scores of many columns at many beginnings against one fit."""

    columns: Integers
    """(c,)."""
    onsets: tuple[int | None, ...]
    """(o,)."""
    score: Floats
    """(o, c)."""
    curvature: Floats
    """After projection, (o, c)."""
    gain: Floats
    """Log-likelihood gained, 0 where the sign is not allowed, (o, c)."""
    statistic: Floats
    """Score over its deviation from day to day, (o, c)."""
    p_value: Floats
    """With the price of searching over all columns and beginnings paid, (o, c)."""

    @property
    def amplitude(self) -> Floats:
        """Amplitude that each would get, (o, c)."""
        return -self.score / np.maximum(self.curvature, 1e-300)


def scan(
    grams: DailyGrams,
    current: Fit,
    chosen: Sequence[int],
    ageing: Sequence[int | None],
    onsets: Sequence[int | None],
    bounds: Floats,
    rng: np.random.Generator,
    flips: int,
) -> Scan:
    """Score columns at beginnings.

    Args:
        grams: of the design.
        current: the fit so far.
        chosen: columns to score, (c,).
        ageing: for each column, the one to subtract per day before its beginning, or None.
        onsets: days of beginning; None is always.
        bounds: smallest and largest amplitude of each column, (c, 2), or at each beginning, (o, c, 2); what is beyond
            counts as much as is within, but for what must not turn round (smallest amplitude 0).
        rng: for the flips.
        flips: how many.
    """
    columns = np.asarray(chosen)
    model = current.model
    active = [RESIDUAL, *model.base]
    days = np.flatnonzero(grams.fit)
    coefficients = np.concatenate([[1.0], current.solution.coefficients])
    joint = current.products[days]
    among = np.ascontiguousarray(joint[:, 1:, 1:])
    # Products of every scored column with [residual, base, terms], by day.
    cross = _cross(grams, active, model.terms, columns)[days]
    own = grams.products[days][:, columns, columns]
    day_score_base = joint[:, 1:, :] @ coefficients
    inverse = current.solution.inverse
    shape = (len(onsets), len(columns))
    score, curvature, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    centred = np.zeros((len(days), *shape))
    shifted = np.array([column is not None for column in ageing])
    shift_columns = np.array([0 if column is None else column for column in ageing])
    shift_cross = _cross(grams, active, model.terms, shift_columns)[days] * shifted[None, :, None]
    shift_own = grams.products[days][:, shift_columns, shift_columns] * shifted
    shift_mixed = grams.products[days][:, columns, shift_columns] * shifted
    for place, onset in enumerate(onsets):
        begun = (days >= (onset or 0)).astype(np.float64)
        first = float(onset or 0)
        part = (cross - first * shift_cross) * begun[:, None, None]
        square = (own - 2.0 * first * shift_mixed + first**2 * shift_own) * begun[:, None]
        weights = part.sum(axis=0)[:, 1:] @ inverse
        day_score = part @ coefficients - day_score_base @ weights.T
        day_curvature = (
            square
            - 2.0 * np.einsum("dcp,cp->dc", part[:, :, 1:], weights)
            + np.einsum("dcq,cq->dc", weights @ among, weights)
        )
        score[place] = (part @ coefficients).sum(axis=0)
        curvature[place] = square.sum(axis=0) - np.einsum("cp,cp->c", part.sum(axis=0)[:, 1:], weights)
        # A column that the base explains altogether has no curvature left, and no slope.
        left = curvature[place] > _EXPLAINED * np.maximum(square.sum(axis=0), 1e-300)
        slope = np.where(left, score[place] / np.where(left, curvature[place], 1.0), 0.0)
        centred[:, place] = day_score - day_curvature * slope
        spread[place] = np.sqrt(np.sum(centred[:, place] ** 2, axis=0))
    usable = curvature > _EXPLAINED * np.maximum(own.sum(axis=0), 1e-300)
    amplitude = -score / np.maximum(curvature, 1e-300)
    low, high = bounds[..., 0], bounds[..., 1]
    allowed = usable & np.where(low >= 0.0, (amplitude > 0.0) & (amplitude >= low), low < high)
    bounded = np.clip(amplitude, low, high)
    gain = np.where(allowed, -bounded * score - 0.5 * bounded**2 * curvature, 0.0)
    spread = np.maximum(spread, 1e-12)
    statistic = np.where(usable, np.abs(score) / spread, 0.0)
    largest = _largest_flipped(centred.reshape(len(days), -1), spread.reshape(-1), usable.reshape(-1), rng, flips)
    p_value = (1.0 + np.sum(largest[:, None, None] >= statistic[None], axis=0)) / (len(largest) + 1.0)
    return Scan(columns, tuple(onsets), score, curvature, gain, np.where(allowed, statistic, 0.0), p_value)


def _cross(grams: DailyGrams, active: Sequence[int], terms: Sequence[Term], columns: Integers) -> Floats:
    """Return products of `columns` with [active, terms] by day, (days, c, p)."""
    plain = grams.products[:, columns[:, None], np.array(active)[None, :]]
    if not terms:
        return plain
    extra = np.empty((grams.days, len(columns), len(terms)))
    for position, term in enumerate(terms):
        first = term.onset or 0
        values = grams.products[:, columns, term.column].copy()
        if term.ageing is not None:
            values -= first * grams.products[:, columns, term.ageing]
        values[:first] = 0.0
        extra[:, :, position] = values
    return np.concatenate([plain, extra], axis=2)


def _largest_flipped(centred: Floats, spread: Floats, usable: Mask, rng: np.random.Generator, flips: int) -> Floats:
    """Return the largest statistic over all columns for each draw of day signs, (flips,)."""
    signs = rng.choice(np.array([-1.0, 1.0]), size=(flips, len(centred)))
    scaled = centred[:, usable] / spread[usable]
    largest: Floats = np.max(np.abs(signs @ scaled), axis=1, initial=0.0)
    return largest


@dataclass(frozen=True)
class Hypothesis:
    """One candidate, pattern or parameter as a term, with what it would gain in the model it was scored against."""

    cause: Candidate | Pattern | str
    """A parameter by its name."""
    term: Term
    gain: float
    amplitude: float
    statistic: float
    p_value: float
    always: float | None = None
    """Gain of the same effect there all the time, of one that begins within the log; None: it does not."""

    @property
    def key(self) -> str:
        """The effect at any shape, the pattern, or the parameter: as gains where nothing had changed are kept."""
        if isinstance(self.cause, str):
            return PARAMETER_PREFIX + self.cause
        return self.cause.effect if isinstance(self.cause, Candidate) else self.cause.key

    @property
    def effect(self) -> str:
        """Name of the effect; nothing else has one."""
        return self.cause.effect if isinstance(self.cause, Candidate) else ""

    @property
    def parameter(self) -> str:
        """Name of the parameter; nothing else has one."""
        return self.cause if isinstance(self.cause, str) else ""


def onset_days(design: Design) -> list[int | None]:
    """Return the days of beginning to be tried; None is always."""
    rules = design.rules
    first, last = rules.first_onset_days, design.split.days - rules.last_onset_days
    step = max(1, -(-(last - first) // rules.most_onsets))
    return [None, *range(first, last + 1, step)]


def score_candidates(
    design: Design, current: Fit, onsets: Sequence[int | None], rng: np.random.Generator
) -> list[Hypothesis]:
    """Return the best hypothesis of every effect, the likeliest first; none where a log shows no effect."""
    if not design.candidates:
        return []
    ageing = [
        shift if candidate.ages else None
        for shift, candidate in zip(design.block("ageing").columns, design.candidates, strict=True)
    ]
    known = {
        (effect, onset): design.amplitude_bounds(effect, onset)
        for effect in dict.fromkeys(one.effect for one in design.candidates)
        for onset in onsets
    }
    bounds = np.array([[known[one.effect, onset] for one in design.candidates] for onset in onsets])
    columns, rules = design.block("effect").columns, design.rules
    scanned = scan(design.grams, current, columns, ageing, onsets, bounds, rng, rules.flips)
    return best_of_each(
        scanned, design.candidates, ageing, [one.effect for one in design.candidates], design.rules.onset_price
    )


def middle_of_best(gains: Floats) -> int:
    """Return the position of the largest gain, (o,), the middle one of several.

    Held-out days tell nothing: within a block of them all beginnings are as likely, and the middle is the least wrong.
    """
    ties = np.flatnonzero(gains >= gains.max() - 1e-9)
    return int(ties[len(ties) // 2])


def score_patterns(
    design: Design, current: Fit, onsets: Sequence[int | None], rng: np.random.Generator
) -> list[Hypothesis]:
    """Return every pattern as a hypothesis, the likeliest first."""
    count, rules = len(design.patterns), design.rules
    bounds = np.tile([-_UNBOUNDED, _UNBOUNDED], (count, 1))
    none: list[int | None] = [None] * count
    scanned = scan(design.grams, current, design.block("pattern").columns, none, onsets, bounds, rng, rules.flips)
    return best_of_each(scanned, design.patterns, none, list(range(count)), design.rules.onset_price)


def best_of_each(
    scanned: Scan,
    causes: Sequence[Candidate] | Sequence[Pattern] | Sequence[str],
    ageing: Sequence[int | None],
    groups: Sequence[object],
    onset_price: float,
) -> list[Hypothesis]:
    """Return the best hypothesis of every group, the likeliest first."""
    price = np.array([0.0 if onset is None else onset_price for onset in scanned.onsets])
    merit = scanned.gain - price[:, None]
    found: dict[object, Hypothesis] = {}
    places = np.array([middle_of_best(column) for column in merit.T], dtype=np.int64)
    for column in np.argsort(-merit[places, np.arange(merit.shape[1])]):
        place = places[column]
        if groups[column] in found or merit[place, column] <= 0.0:
            continue
        onset = scanned.onsets[place]
        found[groups[column]] = Hypothesis(
            causes[column],
            Term(int(scanned.columns[column]), onset, ageing[column] if onset is not None else None),
            float(merit[place, column]),
            float(scanned.amplitude[place, column]),
            float(scanned.statistic[place, column]),
            float(scanned.p_value[place, column]),
        )
    return list(found.values())


def column_of(design: Design, term: Term) -> Floats:
    """Return the column of a term from its beginning on, (b, r, steps)."""
    column: Floats = design.values[term.column]
    if term.onset is None:
        return column
    if term.ageing is not None:
        column = column - term.onset * design.values[term.ageing]
    begun: Floats = np.where((design.line.runs.day >= term.onset)[None, :, None], column, 0.0)
    return begun
