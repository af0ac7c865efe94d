"""Which errors of a log count: of the balances whose sensor it has, at time steps at which all of these were read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.trainer.diagnosis.design.sensitivity import Linearisation
from igrow.trainer.diagnosis.rules import DecisionRules


@dataclass(frozen=True)
class Balances:
    """How errors of a log's runs become those that count."""

    numbers: tuple[int, ...]
    """Of the errors that the log can tell: 0 heat, 1 vapour, 2 CO2."""
    observed: Mask
    """Time steps that have an error in each of them, (r, steps)."""

    def __call__(self, values: Floats) -> Floats:
        """Return of errors or sensitivities, (k, 3, r, steps), those that count, (k, b, r, steps), else 0."""
        return np.where(self.observed, values[:, list(self.numbers)], 0.0)


def balances_of(line: Linearisation, rules: DecisionRules) -> Balances:
    """Return which errors of a log's runs count."""
    weight = line.runs.weight
    numbers = tuple(row for row in range(3) if weight[row].mean() > rules.least_balance_share)
    return Balances(numbers, np.all(weight[list(numbers)], axis=0))
