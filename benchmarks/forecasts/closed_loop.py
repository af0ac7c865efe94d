"""The rules of the actuation stage refitted together in closed loop, over runs of a day.

There what counts is seen: the climate that the rules keep, and the energy and CO2 that they use. Bundles carry the
rules as they were read off the log (`igrow.trainer.fit.actuation`): their planning graph holds heat and CO2 in another
way, and refitted rules made it no better on later weeks of measured greenhouses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.simulator import actuation
from igrow.core.simulator.actuation import RULES
from igrow.core.simulator.closed_loop import closed_run, pipe_heat
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.evaluation import starts_within
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import ROBUST
from igrow.trainer.fit.solver import by_differences, solve

_SCALES = {
    "air_temperature": (0.5, 1 / 12),
    "air_humidity": (4.0, 1 / 12),
    "air_co2": (40.0, 1 / 12),
    "heat": (8.0, 1 / 12),
    "vent_lee": (8.0, 1 / 12),
    "vent_wind": (8.0, 1 / 24),
    "energy_screen": (30.0, 1 / 24),
    "blackout_screen": (30.0, 1 / 24),
    "co2_dosing": (0.0015, 1 / 12),
    "ventilation": (0.0005, 1 / 24),
    "daily:heat": (3.0, 0.5),
    "daily:ventilation": (1.5e-4, 0.5),
    "daily:co2_dosing": (2e-4, 0.5),
}
"""Error that counts as one, and independent errors in each: of half-hour means, and of means over the whole run."""
_HELD = ("lamp_capacity", "lamp_radiation", "co2_capacity", "irrigation_rate")
"""Rules that are read off the log itself."""
_EVALUATIONS = 10
"""Points that are tried at most."""
_MEAN = 1800.0
"""Seconds over which errors are averaged."""

Fluxes = Callable[[Record, Integers, int], Mapping[str, Floats]]
"""Record, starts and steps -> fluxes beside the balances that the runs take along, by channel, (steps, s)."""


def refine_actuation(
    record: Record,
    setpoints: Mapping[str, Floats],
    parameters: Mapping[str, float],
    rules: Mapping[str, float],
    *,
    rows: Mask | None = None,
    fluxes: Fluxes | None = None,
) -> dict[str, float]:
    """Return the rules refitted together, or as they were where no day of the log is complete.

    Args:
        record: the log, on the working grid.
        setpoints: by name, (n,).
        parameters: of the climate stage.
        rules: from `fit_actuation`, where the search starts.
        rows: that may be used, (n,); None: all.
        fluxes: what else is known to enter the balances.
    """
    steps = round(86_400.0 / record.step)
    starts = starts_within(record, np.ones(len(record), dtype=bool) if rows is None else rows, steps, steps)
    if len(starts) == 0:
        return dict(rules)
    states = records.observe(record, parameters, {})
    added = fluxes(record, starts, steps) if fluxes is not None else None
    targets = _targets(record, states, parameters)
    width = max(1, round(_MEAN / record.step))
    whole = steps // width * width
    following = starts + 1 + np.arange(whole)[:, None]

    def means(values: Floats) -> Floats:
        mean: Floats = values[:whole].reshape(whole // width, width, *values.shape[1:]).mean(axis=1)
        return mean

    wanted = {name: means(values[following]) for name, values in targets.items() if name in _SCALES}
    names = [name for name in RULES if name not in _HELD]

    def errors_of(points: Floats) -> dict[str, Floats]:
        trial = dict(rules) | {name: points[:, k : k + 1] for k, name in enumerate(names)}
        out = closed_run(record, states, setpoints, starts, steps, parameters, {}, trial, added)
        errors: dict[str, Floats] = {}
        for name, target in wanted.items():
            predicted = means(np.broadcast_to(out[name], (steps, len(points), len(starts))))
            errors[name] = np.moveaxis(predicted, 1, 0) - target
            if f"daily:{name}" in _SCALES:
                errors[f"daily:{name}"] = np.nanmean(errors[name], axis=1)
        return errors

    def batch(points: Floats) -> Floats:
        found = errors_of(points).items()
        return np.concatenate([errors.reshape(len(points), -1) / _SCALES[name][0] for name, errors in found], axis=1)

    start = np.array([rules[name] for name in names])
    low, high = np.array([RULES[name].low for name in names]), np.array([RULES[name].high for name in names])
    spread = np.maximum(0.5 * np.abs([RULES[name].value for name in names]), 0.04 * (high - low))
    prior = Gaussian(tuple(names), start, np.diag(spread**2))
    weights = np.concatenate(
        [_SCALES[name][1] * np.isfinite(errors[0]).ravel() for name, errors in errors_of(start[None]).items()]
    )
    residuals, jacobian = by_differences(batch, prior, high)
    found = solve(residuals, jacobian, prior, low, high, weights=weights, robust=ROBUST, evaluations=_EVALUATIONS)
    return dict(rules) | found.posterior.values


def _targets(record: Record, states: Mapping[str, Floats], parameters: Mapping[str, float]) -> dict[str, Floats]:
    """Return what a run should give, by name, (n,): the climate, what the actuators did, heat and air exchange."""
    drivers = climate.derive(np, states, record.inputs, parameters, record.lamp_efficacy)
    targets: dict[str, Floats] = dict(record.measured)
    targets |= {name: record.inputs[name] for name in actuation.OUTPUTS if name not in record.missing}
    targets |= {"heat": pipe_heat(drivers, parameters), "ventilation": drivers["ventilation"]}
    if "co2_dosing" in record.missing:
        targets.pop("air_co2")
    return targets
