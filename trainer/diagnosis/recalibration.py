"""Parameters and noise of a log, fitted by turns: where the search linearises the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.trainer.data.splits import DaySplit
from igrow.trainer.diagnosis import noise, sensitivity
from igrow.trainer.diagnosis.knowledge import clipped
from igrow.trainer.diagnosis.noise import Whitening
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.sensitivity import Linearisation
from igrow.trainer.fit.gaussian import Gaussian


@dataclass(frozen=True)
class Averaging:
    """How errors of a log's runs become those that count: balances at hand, means over intervals."""

    balances: tuple[int, ...]
    """Of the errors that the log can tell, of 0, 1, 2."""
    interval: float
    step: float
    observed: Mask
    """Intervals that have an error in every balance at hand in each of their time steps, (r, intervals)."""

    def __call__(self, values: Floats) -> Floats:
        """Turn errors or sensitivities, (k, 3, r, steps), into means, (k, b, r, intervals), 0 where none counts."""
        return averaged(values[:, list(self.balances)], self.step, self.interval) * self.observed


def averaging(line: Linearisation, interval: float, rules: DecisionRules) -> Averaging:
    """Return how the errors of a log's runs are averaged."""
    runs, step = line.runs, line.record.step
    balances = tuple(row for row in range(3) if runs.weight[row].mean() > rules.least_balance_share)
    complete = np.all(runs.weight[list(balances)], axis=0).astype(np.float64)
    return Averaging(balances, interval, step, averaged(complete, step, interval) > 1.0 - 1e-9)


def averaged(values: Floats, step: float, interval: float) -> Floats:
    """Return means over intervals along the last axis, (..., steps) to (..., intervals).

    Within the hour a greenhouse answers to a flux as its fast masses do (leaves, cover, the sensor's housing), which
    the balances may not have; the mean of an hour hardly depends on them.

    Args:
        values: by time step.
        step: its length, s.
        interval: s; one step at least.
    """
    size = max(1, round(interval / step))
    count = values.shape[-1] // size
    return np.asarray(values[..., : count * size].reshape(*values.shape[:-1], count, size).mean(axis=-1))


def recalibrate(
    start: Linearisation, split: DaySplit, prior: Gaussian, misfit: Floats, average: Averaging, rules: DecisionRules
) -> tuple[Linearisation, Whitening]:
    """Fit parameters under their prior and the noise to the fit days, by turns; return both.

    Args:
        start: the model at the prior's mean.
        split: days to fit.
        prior: of the parameters.
        misfit: the expected discrepancy, added to the errors, (b, r, intervals).
        average: of the errors.
        rules: how many turns.
    """
    line, runs, names = start, start.runs, prior.names
    fitted = split.fit[runs.day][:, None]
    whitening = noise.fit_noise(average(line.errors[None])[0] + misfit, average.observed, fitted)
    values = prior.mean
    for _ in range(rules.noise_rounds):
        slopes = sensitivity.parameter_sensitivities(line, names, prior.standard_deviation)
        stack = average(np.concatenate([line.errors[None], slopes]))
        stack[0] += misfit
        flat = (whitening(stack) * fitted).reshape(len(stack), -1)
        products = flat @ flat.T
        # The prior's mean is where the search began, not where this turn stands.
        right = -products[1:, 0] - prior.precision @ (values - prior.mean)
        moved = clipped(names, values + np.linalg.solve(products[1:, 1:] + prior.precision, right))
        line = sensitivity.linearise(line.record, runs, {**line.parameters, **moved}, line.effects)
        values = np.array([line.parameters[name] for name in names])
        whitening = noise.fit_noise(average(line.errors[None])[0] + misfit, average.observed, fitted, whitening)
    return line, whitening
