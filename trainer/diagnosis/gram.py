"""All that a linear search needs to know of a log: one Gram matrix of weighted innovations a day.

With the residual and every sensitivity filtered to innovations and weighted, the products of all columns over a
day are sufficient for least squares over any set of days, terms and beginnings: a search over hundreds of
models then costs no further pass over the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RESIDUAL = 0
"""Column of the residual in every Gram matrix."""


@dataclass(frozen=True)
class Term:
    """A column of the Gram matrices that a model holds, from a day on."""

    column: int
    onset: int | None = None
    """Index of the day it begins; None is from the start."""
    ageing: int | None = None
    """Column to subtract once for each day before the onset, for an effect that grows with time."""


@dataclass(frozen=True)
class DailyGrams:
    """Products of columns by day."""

    products: Floats
    """(days, q, q); column 0 is the residual."""
    fit: NDArray[np.bool_]
    """Days that may be fitted, (days,)."""

    @property
    def days(self) -> int:
        """Number of days."""
        return len(self.products)

    def of(self, base: Sequence[int], terms: Sequence[Term]) -> Floats:
        """Return the products of [residual, base columns, terms], (days, p, p)."""
        plain = [RESIDUAL, *base]
        if all(term.onset is None for term in terms):
            chosen = np.array(plain + [term.column for term in terms])
            picked: Floats = self.products[:, chosen[:, None], chosen[None, :]]
            return picked
        size = len(plain) + len(terms)
        transform = np.zeros((self.days, self.products.shape[1], size))
        transform[:, plain, np.arange(len(plain))] = 1.0
        for position, term in enumerate(terms, start=len(plain)):
            first = term.onset or 0
            transform[first:, term.column, position] = 1.0
            if term.ageing is not None:
                transform[first:, term.ageing, position] = -float(first)
        joined: Floats = np.matmul(transform.transpose(0, 2, 1), np.matmul(self.products, transform))
        return joined


def daily_products(columns: Floats, day: NDArray[np.int64], count: int) -> Floats:
    """Return Gram matrices by day.

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
    """Half the fall of the penalised sum of squares against all coefficients at the prior's mean."""


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
    inverse = np.linalg.pinv(matrix * scale[:, None] * scale[None, :], hermitian=True, rcond=1e-12)
    inverse = inverse * scale[:, None] * scale[None, :]
    coefficients = inverse @ right
    return Solution(coefficients, inverse, 0.5 * float(right @ coefficients))


def day_losses(products: Floats, coefficients: Floats) -> Floats:
    """Return half the sum of squared innovations of each day, (days,), at given coefficients."""
    vector = np.concatenate([[1.0], coefficients])
    losses: Floats = 0.5 * np.einsum("i,dij,j->d", vector, products, vector)
    return losses
