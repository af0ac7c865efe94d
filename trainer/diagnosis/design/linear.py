"""Least squares from daily products: all that a linear search needs to know of a log.

With the residual and every sensitivity filtered to innovations and weighted, the products of all columns over a
day (their Gram matrix) are sufficient for least squares over any set of days, terms and beginnings: a search over
hundreds of models then costs no further pass over the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask

RESIDUAL = 0
"""Column of the residual in every Gram matrix."""
_SINGULAR = 1e-12
"""Share of the largest eigenvalue below which a direction of the scaled normal matrix counts as none."""


@dataclass(frozen=True)
class Term:
    """A column of the Gram matrices that a model holds, from a day on."""

    column: int
    onset: int | None = None
    """Index of the day it begins; None is from the start."""
    ageing: int | None = None
    """Column to subtract once for each day before the onset, for an effect that grows with time."""


@dataclass(frozen=True)
class LinearModel:
    """Columns under a prior, and free terms."""

    base: tuple[int, ...]
    precision: Floats
    """Of the prior of the base's coefficients, (b, b)."""
    mean: Floats
    """Of that prior, (b,)."""
    terms: tuple[Term, ...] = ()

    def with_term(self, term: Term) -> LinearModel:
        """Return the model with one term more."""
        return replace(self, terms=(*self.terms, term))


@dataclass(frozen=True)
class DailyGrams:
    """Products of columns by day."""

    products: Floats
    """(days, q, q); column 0 is the residual."""
    fit: Mask
    """Days that may be fitted, (days,)."""

    @property
    def days(self) -> int:
        """Number of days."""
        return len(self.products)

    def of(self, base: Sequence[int], terms: Sequence[Term]) -> Floats:
        """Return the products of [residual, base columns, terms], (days, p, p)."""
        plain = [RESIDUAL, *base]
        # An ageing column is carried along, taken off its term, and dropped.
        carried = [term.ageing for term in terms if term.ageing is not None]
        chosen = np.array([*plain, *(term.column for term in terms), *carried])
        picked: Floats = self.products[:, chosen[:, None], chosen[None, :]]
        size = len(plain) + len(terms)
        shift = size
        for position, term in enumerate(terms, start=len(plain)):
            first = term.onset or 0
            if term.ageing is not None:
                picked[:, position] -= first * picked[:, shift]
                picked[:, :, position] -= first * picked[:, :, shift]
                shift += 1
            picked[:first, position] = 0.0
            picked[:first, :, position] = 0.0
        return np.asarray(picked[:, :size, :size])


def daily_products(columns: Floats, day: Integers, count: int) -> Floats:
    """Return Gram matrices by day, (count, q, q).

    Args:
        columns: whitened columns, (q, b, r, steps).
        day: index of the day of each run, (r,).
        count: number of days.
    """
    products = np.zeros((count, len(columns), len(columns)))
    for run, index in enumerate(day):
        part = columns[:, :, run].reshape(len(columns), -1)
        products[index] += part @ part.T
    return products


@dataclass(frozen=True)
class Solution:
    """Penalised least squares."""

    coefficients: Floats
    """(p,)."""
    inverse: Floats
    """(p, p), the posterior covariance were the innovations of unit variance."""
    gain: float
    """Half the fall of the penalised sum of squares against all coefficients at zero."""


@dataclass(frozen=True)
class Fit:
    """A model fitted to the fit days."""

    model: LinearModel
    solution: Solution
    products: Floats
    """Of [residual, base, terms], by day, (days, p, p)."""

    @property
    def amplitudes(self) -> Floats:
        """Fitted amplitudes of the terms, (terms,)."""
        return self.solution.coefficients[len(self.model.base) :]

    @property
    def deviations(self) -> Floats:
        """Their standard deviations were the innovations white and of unit variance, (terms,)."""
        return np.sqrt(np.diag(self.solution.inverse)[len(self.model.base) :])

    @property
    def day_losses(self) -> Floats:
        """Half the sum of squared innovations of each day, (days,)."""
        vector = np.concatenate([[1.0], self.solution.coefficients])
        return np.asarray(0.5 * np.einsum("i,dij,j->d", vector, self.products, vector))


def solve(products: Floats, precision: Floats) -> Solution:
    """Solve for coefficients.

    Args:
        products: of [residual, columns], (p + 1, p + 1).
        precision: of the prior on the coefficients (mean 0), (p, p).
    """
    matrix = products[1:, 1:] + precision
    # The residual's columns are d(error)/d(coefficient): the fit subtracts them.
    right = -products[1:, 0]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale[None, :], hermitian=True, rcond=_SINGULAR)
    inverse = inverse * scale[:, None] * scale[None, :]
    coefficients = inverse @ right
    return Solution(coefficients, inverse, 0.5 * float(right @ coefficients))


def fit(grams: DailyGrams, model: LinearModel) -> Fit:
    """Fit a model to the fit days."""
    products = grams.of(model.base, model.terms)
    total = products[grams.fit].sum(axis=0)
    size = len(model.base)
    precision = np.zeros((size + len(model.terms),) * 2)
    precision[:size, :size] = model.precision
    # The prior pulls towards its mean, from which the linearisation may stand away.
    pull = np.zeros(len(total))
    pull[1 : size + 1] = -(model.precision @ model.mean)
    total[0, :] += pull
    total[:, 0] += pull
    return Fit(model, solve(total, precision), products)


def deviation_by_day(grams: DailyGrams, fitted: Fit) -> float:
    """Return the standard deviation of the last term's amplitude, from the scatter of its day scores if that is larger.

    The sandwich estimator (White 1982, Econometrica 50, 1-25) over days.
    """
    days = np.flatnonzero(grams.fit)
    coefficients = np.concatenate([[1.0], fitted.solution.coefficients])
    influence = fitted.products[days][:, 1:, :] @ coefficients @ fitted.solution.inverse[-1]
    scatter = float(np.sqrt(np.sum((influence - influence.mean()) ** 2) * len(days) / max(len(days) - 1, 1)))
    return max(float(fitted.deviations[-1]), scatter)
