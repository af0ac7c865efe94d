"""Whether the bundle in force predicts worse than it did, and since when.

A tabular CUSUM over its live errors a day ahead (Page 1954, Biometrika 41:100; Montgomery, Introduction to Statistical
Quality Control, ch. 9): what lies more than half a standard deviation above the first days is added up, and an excess
of five standard deviations is no chance. Weather alone makes predictions a little worse for weeks, so the days since
the sum last left zero must be half as wrong again in the mean. That day dates no change: one odd day holds the sum up
until the change comes. The change is dated by maximum likelihood (Hinkley 1970, Biometrika 57:1; Pignatiello and Samuel
2001, Journal of Quality Technology 33:357): where a step parts the days best.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.quantities import difference_with_unit

DAY = 86_400.0
REFERENCE_DAYS = 5
"""Days after which it is known how wrong a bundle is when all is well."""
SLACK, LIMIT = 0.5, 5.0
"""Allowance and decision interval of the CUSUM, in standard deviations."""
LEAST_SCATTER = 0.2
"""Standard deviation, as a share of the mean, that days have at least: five of them tell little of their scatter."""
LEAST_ERROR = 0.1
"""Of the mean error, what a day counts at least when the change is dated: an error of nothing has no logarithm."""
LEAST_RATIO = 1.5
"""Mean error since the change over that of the first days."""
HORIZON = " 24_h"


@dataclass(frozen=True)
class Worsening:
    """One quantity that is predicted worse than it was."""

    quantity: str
    since: float
    """Seconds since 1970 UTC."""
    before: float
    """Mean absolute error a day ahead in the first days of the bundle, in the quantity's unit."""
    now: float
    """The same since the change."""


def find_worsening(history: Sequence[tuple[float, Mapping[str, float]]]) -> tuple[Worsening, ...]:
    """Return the quantities that one bundle predicts worse than it did, the longest since first.

    Args:
        history: time and live errors by "quantity horizon" while this bundle was in force, oldest first.
    """
    names = {key.removesuffix(HORIZON) for _, errors in history for key in errors if key.endswith(HORIZON)}
    found = [one for name in sorted(names) if (one := _worsening(name, history)) is not None]
    return tuple(sorted(found, key=lambda one: one.since))


def worsening_sentence(found: Sequence[Worsening]) -> str:
    """Return what to tell people, in one line; times are in UTC."""
    since = datetime.fromtimestamp(min(one.since for one in found), UTC)
    how = ", ".join(f"{one.quantity} {_error(one, one.before)} -> {_error(one, one.now)}" for one in found)
    return (
        f"the simulator predicts a day ahead worse since {since:%Y-%m-%d %H:%M} UTC ({how}): "
        "something in the greenhouse has changed; the trainer looks for the cause at its next run"
    )


def _error(one: Worsening, value: float) -> str:
    return difference_with_unit(one.quantity, value, ".3g")


def _worsening(quantity: str, history: Sequence[tuple[float, Mapping[str, float]]]) -> Worsening | None:
    days = _days([(time, errors[quantity + HORIZON]) for time, errors in history if quantity + HORIZON in errors])
    reference = [error for _, error in days[:REFERENCE_DAYS]]
    if len(days) <= REFERENCE_DAYS:
        return None
    mean = float(np.mean(reference))
    scatter = max(float(np.std(reference, ddof=1)), LEAST_SCATTER * mean, 1e-9)
    total, left_zero = 0.0, REFERENCE_DAYS
    for number, (_, error) in enumerate(days[REFERENCE_DAYS:], REFERENCE_DAYS):
        if total <= 0.0:
            left_zero = number
        total = max(0.0, total + (error - mean) / scatter - SLACK)
    errors = np.array([error for _, error in days])
    if total <= LIMIT or errors[left_zero:].mean() <= LEAST_RATIO * mean:
        return None
    first = _first_worse(errors)
    return Worsening(quantity, days[first][0] - DAY, mean, float(errors[first:].mean()))


def _first_worse(errors: Floats) -> int:
    """Return the first day after the step upwards that parts a course (n,) best, after the days of reference.

    In logarithms, since errors scatter in proportion to themselves.
    """
    numbers = np.arange(REFERENCE_DAYS, len(errors))
    sums = np.cumsum(np.log(np.maximum(errors, LEAST_ERROR * errors.mean())))
    before, after = sums[numbers - 1] / numbers, (sums[-1] - sums[numbers - 1]) / (len(errors) - numbers)
    parted = numbers * (len(errors) - numbers) * np.maximum(after - before, 0.0) ** 2
    return int(numbers[np.argmax(parted)])


def _days(errors: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return one error a day, since those of less than a day apart are of the same hours."""
    kept: list[tuple[float, float]] = []
    for time, error in errors:
        if np.isfinite(error) and (not kept or time - kept[-1][0] >= 0.99 * DAY):
            kept.append((time, error))
    return kept
