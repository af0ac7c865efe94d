"""What the last days used and grew, over what the simulator says of them: the factor that plans are corrected by.

No simulator is right on average at every site and in every week, and a search prefers what it errs on in its favour
(the winner's curse). Run again over the days that have just passed, from what was measured, under their weather and
the setpoints that were in force, it shows by how much it errs on what plans did; the next plan is expected to err as
much (model output statistics; Glahn and Lowry (1972), J. Appl. Meteor. 11, 1203-1211).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from igrow.core.planner.objective import Outcome, Simulator
from igrow.core.site import Greenhouse
from igrow.core.telemetry import Telemetry

Values = NDArray[np.float64]

SCALED = ("heat", "electricity", "co2", "net_growth")
"""What plans are paid and charged for."""
_STEADY_DAYS = 1.0
"""Days of "no error" that count beside those that have passed, so that one odd day does not decide."""
_LARGEST = 2.0
"""Largest factor, and the inverse of the smallest: beyond it the simulator is wrong, and no factor mends it."""


def factors(expected: Mapping[str, Values], used: Mapping[str, Values]) -> dict[str, float]:
    """Return the factor of each of `SCALED`: what was used over what was expected, drawn towards one.

    Args:
        expected: by name, each day's total, (days,).
        used: the same as measured; NaN where it was not.
    """
    result = {}
    for name in SCALED:
        known = np.isfinite(used[name]) & np.isfinite(expected[name])
        steady = _STEADY_DAYS * float(np.abs(used[name][known]).mean()) if known.any() else 0.0
        below = steady + float(expected[name][known].sum())
        above = steady + float(used[name][known].sum())
        result[name] = float(np.clip(above / below, 1.0 / _LARGEST, _LARGEST)) if below > 0.0 < above else 1.0
    return result


def totals(outcome: Outcome) -> dict[str, Values]:
    """Return the totals of an outcome by `SCALED`, mean over the ensemble, (B,)."""
    return {name: getattr(outcome, name).sum(axis=-1).mean(axis=0) for name in SCALED}


def used_in(log: Telemetry, greenhouse: Greenhouse) -> dict[str, float]:
    """Return what a log of some hours says was used and grown, by `SCALED`; NaN where it does not say.

    Heat is what leaves the pipes by the site's coefficients; growth is the difference of its last and first value.
    """
    # Each of n rows stands for a step, but from the first to the last there are n - 1.
    whole = len(log) / (len(log) - 1.0) if len(log) > 1 else np.nan
    hours = whole * float((log.time[-1] - log.time[0]) / np.timedelta64(1, "s")) / 3600.0 if len(log) > 1 else np.nan
    nothing = np.full(len(log), np.nan)

    def column(name: str) -> Values:
        return log.columns.get(name, nothing)

    def total(values: Values) -> float:
        known = np.isfinite(values)
        return float(values[known].mean()) * hours if known.sum() > 0.5 * len(values) else float("nan")

    rail, grow = (
        np.maximum(column(f"{name}_pipe_temperature") - column("air_temperature"), 0.0) for name in ("rail", "grow")
    )
    # A house without a grow pipe reports none.
    grow = np.where(np.isfinite(grow), grow, 0.0)
    pipes = greenhouse.rail_pipe_heat_transfer * rail + greenhouse.grow_pipe_heat_transfer * grow
    grown = column("net_growth")
    counted = bool(len(grown)) and bool(np.isfinite(grown[[0, -1]]).all())
    return {
        "heat": total(pipes) * 3.6e-3,
        "electricity": total(column("lamp_power")) * 1e-3,
        "co2": total(column("co2_dosing")),
        "net_growth": whole * float(grown[-1] - grown[0]) if counted else float("nan"),
    }


@dataclass(frozen=True)
class Scaled:
    """A simulator whose amounts are multiplied by `factors`; implements `objective.Simulator`."""

    simulator: Simulator
    factor: Mapping[str, float]
    """By `SCALED`."""

    def simulate(self, initial: dict[str, float], weather: Values, setpoints: Values, start: np.datetime64) -> Outcome:
        """Return what candidates do; see `objective.Simulator`."""
        outcome = self.simulator.simulate(initial, weather, setpoints, start)
        return replace(outcome, **{name: self.factor[name] * getattr(outcome, name) for name in SCALED})
