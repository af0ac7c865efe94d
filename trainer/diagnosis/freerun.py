"""Free runs on days that nothing was fitted to: how far off a forecast is, and how much an effect moves it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid import measurement
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import Record, complete_starts, free_run, observe
from igrow.trainer.data.splits import DaySplit as Split
from igrow.trainer.diagnosis.linearisation import Floats

HORIZONS: Mapping[str, float] = {"1_step": 0.0, "24_h": 86_400.0, "7_d": 604_800.0}
"""Seconds of each free run; 0 is one row."""
_EVERY = 10_800.0
"""Seconds between the starts of 24 h runs."""
ENR_STRIDE = 1800.0
"""Seconds between compared rows of a free run."""


@dataclass(frozen=True)
class Runs:
    """Free runs from several starts against what was measured."""

    shown: Mapping[str, Floats]
    """By quantity, (steps, s)."""
    errors: Mapping[str, Floats]
    """Predicted minus measured, NaN where not measured or not counted, (steps, s)."""
    day: NDArray[np.int64]
    """Day of each start, (s,)."""


def run(
    record: Record,
    split: Split,
    parameters: Mapping[str, float],
    effects: ActiveEffects,
    horizon: str,
    *,
    held_out: bool = True,
    added: Mapping[str, Floats] | None = None,
) -> Runs | None:
    """Run freely over a horizon and compare on held-out days (or on fit days); None where no run fits.

    Runs of 24 h lie on such days altogether; runs of seven days start anywhere, and count on such days alone.
    """
    steps = max(1, round(HORIZONS[horizon] / record.step))
    if steps + 1 >= len(record):
        return None
    wanted = ~split.fit_rows if held_out else split.fit_rows
    every = max(1, round((_EVERY if horizon == "24_h" else 86_400.0 if horizon == "7_d" else 1500.0) / record.step))
    starts = complete_starts(record, steps, every)
    outside = np.concatenate([[0], np.cumsum(~wanted)])
    if horizon == "7_d":
        starts = starts[outside[starts + steps] - outside[starts] < steps]
    else:
        starts = starts[outside[starts + steps + 1] - outside[starts] == 0]
    if len(starts) == 0:
        return None
    states = observe(record, parameters, effects)
    shown = free_run(record, states, starts, steps, parameters, effects, added)
    rows = starts + 1 + np.arange(steps)[:, None]
    errors = {}
    for name in measurement.PREDICTED:
        error = shown[name] - record.measured[name][rows]
        errors[name] = np.where(wanted[rows], error, np.nan)
    return Runs(shown, errors, split.day[starts])


def root_mean_square(values: Floats) -> float:
    """Return the root of the mean square over what is finite (NaN for nothing)."""
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def effect_to_noise(plain: Runs, corrected: Runs) -> float:
    """Return ENR: RMS of what an effect moves in a 24 h free run over the RMS that stays, the largest of quantities."""
    ratios = [
        root_mean_square(corrected.shown[name] - plain.shown[name])
        / max(root_mean_square(corrected.errors[name]), 1e-9)
        for name in plain.shown
        if np.isfinite(plain.errors[name]).any()
    ]
    return max(ratios) if ratios else 0.0


def skill_by_day(before: Runs, after: Runs) -> Floats:
    """Return by day the fall of the squared error over its mean before, mean over quantities, (days,)."""
    days = np.unique(before.day)
    skill = np.zeros(len(days))
    quantities = [name for name in before.errors if np.isfinite(before.errors[name]).any()]
    for name in quantities:
        scale = np.nanmean(before.errors[name] ** 2)
        fall = (before.errors[name] ** 2 - after.errors[name] ** 2) / scale
        for index, day in enumerate(days):
            part = fall[:, before.day == day]
            skill[index] += np.nanmean(part) / len(quantities) if np.isfinite(part).any() else 0.0
    return skill
