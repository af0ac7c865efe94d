"""Free runs: parameters fitted to those of the fit days, errors and skill on days that nothing was fitted to.

A forecast is judged by its free run, so the parameters that are shipped are those that serve it. That is what
`recalibrated` and `corrected` mean in the tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.simulator.hybrid import measurement
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record, complete_starts, free_run, observe
from igrow.trainer.data.splits import DaySplit
from igrow.trainer.diagnosis import sensitivity
from igrow.trainer.diagnosis.knowledge import clipped
from igrow.trainer.diagnosis.sensitivity import DayRuns, Linearisation
from igrow.trainer.fit import solver
from igrow.trainer.fit.climate import bounds
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import CORRELATION_TIME, ERROR_SCALES, ROBUST

HORIZONS: Mapping[str, float] = {"1_step": 0.0, "24_h": 86_400.0, "7_d": 604_800.0}
"""Seconds of each free run; 0 is one time step."""
EVERY: Mapping[str, float] = {"1_step": 1500.0, "24_h": 10_800.0, "7_d": 86_400.0}
"""Seconds between the starts of runs."""
EVALUATIONS = 20
"""Points that a fit may try."""


@dataclass(frozen=True)
class FreeRuns:
    """Free runs from several starts against what was measured."""

    shown: Mapping[str, Floats]
    """By quantity, (steps, s)."""
    errors: Mapping[str, Floats]
    """Predicted minus measured, NaN where not measured or not counted, (steps, s)."""
    day: Integers
    """Day of each start, (s,)."""


def fit_parameters(
    record: Record,
    runs: DayRuns,
    split: DaySplit,
    prior: Gaussian,
    effects: ActiveEffects,
    start: Mapping[str, float] | None = None,
    added: Mapping[str, Floats] | None = None,
) -> Gaussian:
    """Return the posterior of the parameters.

    Args:
        record: of the log.
        runs: its day-long runs.
        split: only fit days count.
        prior: of the parameters.
        effects: active, held.
        start: where to begin, by name (None: the prior's mean).
        added: further fluxes by channel, (n,).

    Raises:
        DivergenceError: the model runs out of all bounds where the fit begins.
    """
    scale = np.array([ERROR_SCALES[name] for name in measurement.PREDICTED])[:, None, None]
    counted = (runs.weight & split.fit[runs.day][None, :, None]).ravel()
    low, high = bounds(prior.names)
    begin = np.array([(start or prior.values)[name] for name in prior.names])

    def line(point: Floats) -> Linearisation:
        return sensitivity.linearise(record, runs, clipped(prior.names, point), effects, added)

    def residuals(point: Floats) -> Floats:
        flat: Floats = (line(point).errors / scale).ravel()[counted]
        return flat

    def jacobian(point: Floats) -> Floats:
        slopes = sensitivity.parameter_sensitivities(line(point), prior.names, prior.standard_deviation)
        flat: Floats = (slopes / scale).reshape(len(slopes), -1)[:, counted].T
        return flat

    weight = record.step / CORRELATION_TIME
    return solver.solve(
        residuals, jacobian, prior, low, high, weights=weight, robust=ROBUST, start=begin, evaluations=EVALUATIONS
    ).posterior


def run(
    record: Record,
    split: DaySplit,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    horizon: str,
    *,
    added: Mapping[str, Floats] | None = None,
) -> FreeRuns | None:
    """Run freely over a horizon and compare on held-out days; None where no run fits.

    Runs of 24 h lie on such days altogether; runs of seven days start anywhere, and count on such days alone.
    """
    steps = max(1, round(HORIZONS[horizon] / record.step))
    if steps + 1 >= len(record):
        return None
    wanted = ~split.fit_rows
    starts = complete_starts(record, steps, max(1, round(EVERY[horizon] / record.step)))
    outside = np.concatenate([[0], np.cumsum(~wanted)])
    if horizon == "7_d":
        starts = starts[outside[starts + steps] - outside[starts] < steps]
    else:
        starts = starts[outside[starts + steps + 1] - outside[starts] == 0]
    if len(starts) == 0:
        return None
    states = observe(record, parameters, effects)
    shown = free_run(record, states, starts, steps, parameters, effects, added)
    samples = starts + 1 + np.arange(steps)[:, None]
    errors = {}
    for name in measurement.PREDICTED:
        error = shown[name] - record.measured[name][samples]
        errors[name] = np.where(wanted[samples], error, np.nan)
    return FreeRuns(shown, errors, split.day[starts])


def root_mean_square(values: Floats) -> float:
    """Return the root of the mean square over what is finite (NaN for nothing)."""
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def effect_to_noise(plain: FreeRuns, corrected: FreeRuns) -> float:
    """Return ENR: RMS of what an effect moves in a 24 h free run over the RMS that stays, the largest of quantities."""
    ratios = [
        root_mean_square(corrected.shown[name] - plain.shown[name])
        / max(root_mean_square(corrected.errors[name]), 1e-9)
        for name in plain.shown
        if np.isfinite(plain.errors[name]).any()
    ]
    return max(ratios) if ratios else 0.0


def skill(before: FreeRuns, after: FreeRuns) -> float:
    """Return the fall of the squared error over its mean before, mean over quantities and days."""
    return float(skill_by_day(before, after).mean())


def skill_by_day(before: FreeRuns, after: FreeRuns) -> Floats:
    """Return the fall of the squared error on each day over the mean of all days before, mean over quantities, (d,)."""
    days = np.unique(before.day)
    by_day = np.zeros(len(days))
    quantities = [name for name in before.errors if np.isfinite(before.errors[name]).any()]
    for name in quantities:
        scale = np.nanmean(before.errors[name] ** 2)
        fall = (before.errors[name] ** 2 - after.errors[name] ** 2) / scale
        for index, day in enumerate(days):
            part = fall[:, before.day == day]
            by_day[index] += np.nanmean(part) / len(quantities) if np.isfinite(part).any() else 0.0
    return by_day


def mean_absolute_errors(runs: FreeRuns | None) -> dict[str, float]:
    """Return the mean absolute error of each quantity that was measured."""
    if runs is None:
        return {}
    return {name: float(np.nanmean(np.abs(error))) for name, error in runs.errors.items() if np.isfinite(error).any()}
