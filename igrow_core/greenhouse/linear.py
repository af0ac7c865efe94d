"""A small dense linear system, many times at once."""

from __future__ import annotations

from igrow.core.arrays import Array


def solve(matrix: list[list[Array]], right: list[Array]) -> list[Array]:
    """Solve matrix x = right by elimination without pivoting; both are overwritten.

    Entries are floats or arrays (N,). It needs a diagonal that dominates, which balances of exchange and storage
    have. On lists this is four times as fast for one system, and as fast for many, as numpy.linalg.solve,
    which wants the matrices one after the other.
    """
    size = len(right)
    for pivot in range(size):
        row = matrix[pivot]
        inverse = 1.0 / row[pivot]
        active = [column for column in range(pivot + 1, size) if row[column] is not ZERO]
        for below in range(pivot + 1, size):
            target = matrix[below]
            entry = target[pivot]
            if entry is ZERO:
                continue
            factor = entry * inverse
            for column in active:
                target[column] = target[column] - factor * row[column]
            right[below] = right[below] - factor * right[pivot]
    for pivot in range(size - 1, -1, -1):
        row = matrix[pivot]
        total = right[pivot]
        for column in range(pivot + 1, size):
            if row[column] is not ZERO:
                total = total - row[column] * right[column]
        right[pivot] = total / row[pivot]
    return right


ZERO = 0.0
"""The one object that marks an entry known to be zero."""
