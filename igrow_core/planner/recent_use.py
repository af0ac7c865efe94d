"""What the last days used and grew, over what the simulator says of them: what plans are corrected by.

No simulator is right on average at every site and in every week, and a search prefers what it errs on in its favour
(the winner's curse). Run again over the days that have just passed, from what was measured, under their weather and
the setpoints that were in force, it shows by how much it errs on what plans did; the next plan is expected to err as
much (model output statistics; Glahn and Lowry (1972), J. Appl. Meteor. 11, 1203-1211). Resources are corrected by a
factor each, the air's temperature by a difference, growth by its conversion and its maintenance
(`igrow.core.simulator.growth`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.simulator.growth import Count, GrowthBalance, GrowthDays, GrowthFit, regress, warmth
from igrow.core.simulator.outcome import Initial, Outcome, Simulator
from igrow.core.site import Crop, Greenhouse
from igrow.core.telemetry import Telemetry

SCALED = ("heat", "electricity", "co2")
"""What plans are charged for."""
GROWTH_ERROR = 0.2
"""Standard deviation of a day's growth over its size, as a simulator errs on single days."""
_STEADY_DAYS = 1.0
"""Days of "no error" that count beside those that have passed, so that one odd day does not decide."""
_LARGEST = 2.0
"""Largest factor, and the inverse of the smallest: beyond it the simulator is wrong, and no factor mends it."""
_WARMEST = 1.0
"""Largest difference of the air's temperature, K: what a cold day costs doubles within it."""


def factors(expected: Mapping[str, Floats], used: Mapping[str, Floats]) -> dict[str, float]:
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


def warmer(expected: Floats, measured: Floats) -> float:
    """Return by how much the air was warmer than expected, K, by means of days (days,), drawn towards nothing.

    The PLC's control leaves an offset that is alike from day to day, and what a cold day costs hangs on tenths of it.
    """
    known = np.isfinite(expected) & np.isfinite(measured)
    difference = float((measured - expected)[known].sum()) / (_STEADY_DAYS + known.sum())
    return float(np.clip(difference, -_WARMEST, _WARMEST))


def totals(outcome: Outcome) -> dict[str, Floats]:
    """Return the totals of an outcome by `SCALED` and ``net_growth``, mean over the ensemble, (B,)."""
    return {name: getattr(outcome, name).sum(axis=-1).mean(axis=0) for name in (*SCALED, "net_growth")}


def grown_days(balance: GrowthBalance, outcome: Outcome) -> tuple[float, float]:
    """Return what drove one candidate's growth: CO2 taken up, kg m-2, and warmth, h (see `growth.GrowthDays`)."""
    air = outcome.air_temperature[0, 0]
    return float(balance.assimilated(outcome.net_growth[0, 0], air).sum()), float(warmth(air).sum())


def growth_of_days(
    balance: GrowthBalance, crop: Crop, driven: Sequence[tuple[float, float]], grown: Sequence[float]
) -> GrowthFit:
    """Return conversion and maintenance by days that have passed.

    Args:
        balance: of the simulator, which is what is expected before.
        crop: that grew.
        driven: by day, from `grown_days`.
        grown: net growth of each as counted, kg m-2; NaN where it was not.
    """
    table = np.array(driven, dtype=np.float64).reshape(-1, 2)
    known = np.array([amount for amount in grown if np.isfinite(amount)])
    usual = float(np.abs(known).mean()) if len(known) else 0.0
    counts = [Count(day, day + 1, amount, max(GROWTH_ERROR * usual, 1e-4)) for day, amount in enumerate(grown)]
    mean = np.array([balance.conversion, balance.maintenance])
    return regress(GrowthDays(table[:, 0], table[:, 1]), counts, crop, mean, balance.covariance)


def used_in(log: Telemetry, greenhouse: Greenhouse) -> dict[str, float]:
    """Return what a log of some hours says was used, by `SCALED`, and its ``net_growth``; NaN where it does not say.

    Heat is what leaves the pipes by the site's coefficients; growth is the difference of its last and first value.
    """
    # Each of n rows stands for a step, but from the first to the last there are n - 1.
    whole = len(log) / (len(log) - 1.0) if len(log) > 1 else np.nan
    hours = whole * float((log.time[-1] - log.time[0]) / np.timedelta64(1, "s")) / 3600.0 if len(log) > 1 else np.nan
    nothing = np.full(len(log), np.nan)

    def column(name: str) -> Floats:
        return log.columns.get(name, nothing)

    def total(values: Floats) -> float:
        known = np.isfinite(values)
        return float(values[known].mean()) * hours if known.sum() > 0.5 * len(values) else float("nan")

    rail, grow = (
        np.maximum(column(f"{name}_pipe_temperature") - column("air_temperature"), 0.0) for name in ("rail", "grow")
    )
    # A greenhouse without a grow pipe reports none.
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
class Corrected:
    """A simulator whose resources are multiplied by `factor`, whose air is warmer and whose crop grows as counted."""

    simulator: Simulator
    factor: Mapping[str, float]
    """By `SCALED`."""
    balance: GrowthBalance | None = None
    """What the simulator's growth was computed with; None leaves growth as it is."""
    growth: GrowthFit | None = None
    """What it is to be computed with; its doubt is spread over the ensemble."""
    warmer: float = 0.0
    """K by which the air is warmer; growth was counted at the simulator's own temperatures, and stays there."""

    @property
    def setpoints(self) -> tuple[str, ...]:
        """Those of the simulator."""
        return self.simulator.setpoints

    def simulate(self, initial: Initial, weather: Floats, setpoints: Floats, start: np.datetime64 | Times) -> Outcome:
        """Return what candidates do; see `igrow.core.simulator.outcome.Simulator`."""
        outcome = self.simulator.simulate(initial, weather, setpoints, start)
        changes = {name: self.factor[name] * getattr(outcome, name) for name in SCALED}
        changes["air_temperature"] = outcome.air_temperature + self.warmer
        if self.balance is not None and self.growth is not None:
            changes["net_growth"] = regrown(outcome, self.balance, self.growth)
        return replace(outcome, **changes)


def regrown(outcome: Outcome, balance: GrowthBalance, growth: GrowthFit) -> Floats:
    """Return net growth (M, B, H) as it is with the fitted conversion and maintenance, one draw for each member."""
    pairs = growth.draws(len(outcome.net_growth))[:, :, None, None]
    assimilated = balance.assimilated(outcome.net_growth, outcome.air_temperature)
    return np.asarray(pairs[:, 0] * assimilated - pairs[:, 1] * warmth(outcome.air_temperature))
