"""The search: which term, from which day on, explains most of the innovations, and how surely.

Every column is scored against the residual after the parameters (and what has been accepted before) have taken
their share under their priors. The score of a day is one number; under the hypothesis that nothing is missing its
sign is a coin's. Flipping the signs of whole days and taking the largest statistic over all columns and all
beginnings gives the price of having searched (max-T: Westfall and Young 1993, Resampling-Based Multiple Testing;
day scores centred at each column's own fit, as in a wild bootstrap: Liu 1988, Ann. Statist. 16).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.trainer.diagnosis.gram import RESIDUAL, DailyGrams, Floats, Solution, Term, solve

FLIPS = 999


@dataclass(frozen=True)
class Model:
    """Base columns under their prior, and free terms."""

    base: tuple[int, ...]
    precision: Floats
    """Of the base, (b, b)."""
    shift: Floats
    """Where the base stands against its prior's mean, (b,)."""
    terms: tuple[Term, ...] = ()

    def with_term(self, term: Term) -> Model:
        """Return the model with one term more."""
        return Model(self.base, self.precision, self.shift, (*self.terms, term))


@dataclass(frozen=True)
class Fit:
    """A model fitted to the fit days."""

    model: Model
    solution: Solution
    products: Floats
    """Of [residual, base, terms], by day, (days, p, p)."""

    @property
    def amplitudes(self) -> Floats:
        """Fitted amplitudes of the terms."""
        return self.solution.coefficients[len(self.model.base) :]

    @property
    def deviations(self) -> Floats:
        """Their standard deviations were the innovations white and of unit variance."""
        return np.sqrt(np.diag(self.solution.inverse)[len(self.model.base) :])


def fit(grams: DailyGrams, model: Model) -> Fit:
    """Fit a model to the fit days."""
    products = grams.of(model.base, model.terms)
    total = products[grams.fit].sum(axis=0)
    size = len(model.base)
    precision = np.zeros((size + len(model.terms),) * 2)
    precision[:size, :size] = model.precision
    # The prior pulls towards its mean, from which the linearisation may stand away.
    pull = np.zeros(len(total))
    pull[1 : size + 1] = model.precision @ model.shift
    total = total.copy()
    total[0, :] += pull
    total[:, 0] += pull
    return Fit(model, solve(total, precision), products)


@dataclass(frozen=True)
class Scan:
    """Scores of many columns at many beginnings against one fit."""

    columns: NDArray[np.int64]
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
    columns: Sequence[int] | NDArray[np.int64],
    ageing: Sequence[int | None],
    onsets: Sequence[int | None],
    bounds: Floats,
    rng: np.random.Generator,
) -> Scan:
    """Score columns at beginnings.

    Args:
        grams: of the problem.
        current: the fit so far.
        columns: to score, (c,).
        ageing: for each column, the one to subtract per day before its beginning, or None.
        onsets: days of beginning; None is always.
        bounds: smallest and largest amplitude of each column, (c, 2).
        rng: for the flips.
    """
    columns = np.asarray(columns)
    model = current.model
    active = [RESIDUAL, *model.base]
    days = np.flatnonzero(grams.fit)
    coefficients = np.concatenate([[1.0], current.solution.coefficients])
    joint = current.products[days]
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
    for row, onset in enumerate(onsets):
        begun = (days >= (onset or 0)).astype(np.float64)
        first = float(onset or 0)
        part = (cross - first * shift_cross) * begun[:, None, None]
        square = (own - 2.0 * first * shift_mixed + first**2 * shift_own) * begun[:, None]
        weights = part.sum(axis=0)[:, 1:] @ inverse
        day_score = part @ coefficients - day_score_base @ weights.T
        day_curvature = (
            square
            - 2.0 * np.einsum("dcp,cp->dc", part[:, :, 1:], weights)
            + np.einsum("cp,dpq,cq->dc", weights, joint[:, 1:, 1:], weights, optimize=True)
        )
        score[row] = (part @ coefficients).sum(axis=0)
        curvature[row] = square.sum(axis=0) - np.einsum("cp,cp->c", part.sum(axis=0)[:, 1:], weights)
        # A column that the base explains altogether has no curvature left, and no slope.
        left = curvature[row] > 1e-6 * np.maximum(square.sum(axis=0), 1e-300)
        slope = np.where(left, score[row] / np.where(left, curvature[row], 1.0), 0.0)
        centred[:, row] = day_score - day_curvature * slope
        spread[row] = np.sqrt(np.sum(centred[:, row] ** 2, axis=0))
    usable = curvature > 1e-6 * np.maximum(own.sum(axis=0), 1e-300)
    amplitude = -score / np.maximum(curvature, 1e-300)
    allowed = usable & (amplitude >= bounds[:, 0]) & np.where(bounds[:, 0] >= 0.0, amplitude > 0.0, True)
    bounded = np.clip(amplitude, bounds[:, 0], bounds[:, 1])
    gain = np.where(allowed, -bounded * score - 0.5 * bounded**2 * curvature, 0.0)
    spread = np.maximum(spread, 1e-12)
    statistic = np.where(usable, np.abs(score) / spread, 0.0)
    largest = _largest_flipped(centred.reshape(len(days), -1), spread.reshape(-1), usable.reshape(-1), rng)
    p_value = (1.0 + np.sum(largest[:, None, None] >= statistic[None], axis=0)) / (len(largest) + 1.0)
    return Scan(columns, tuple(onsets), score, curvature, gain, np.where(allowed, statistic, 0.0), p_value)


def _cross(grams: DailyGrams, active: Sequence[int], terms: Sequence[Term], columns: NDArray[np.int64]) -> Floats:
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


def _largest_flipped(centred: Floats, spread: Floats, usable: NDArray[np.bool_], rng: np.random.Generator) -> Floats:
    """Return the largest statistic over all columns for each draw of day signs, (FLIPS,)."""
    signs = rng.choice(np.array([-1.0, 1.0]), size=(FLIPS, len(centred)))
    scaled = centred[:, usable] / spread[usable]
    largest: Floats = np.max(np.abs(signs @ scaled), axis=1, initial=0.0)
    return largest
