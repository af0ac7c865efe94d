"""Calibration of the climate stage on batched free runs, under a prior, with a robust loss."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.calibration.evaluation import starts_within
from igrow.trainer.calibration.least_squares import Problem, Scale, covariance, minimise, observed_scale
from igrow.trainer.calibration.posterior import Posterior

Floats = NDArray[np.float64]

_SPREADS = {"air_temperature": 0.5, "air_humidity": 3.0, "air_co2": 35.0}
"""Residual spread that weighs the quantities against each other while fitting, in the quantity's unit.

Fixed, since a quantity that is predicted badly would else lose its weight and be predicted worse still.
"""
_WORTH = 1.0 / 24.0
"""Independent residuals in each one kept, while fitting: a correlation time of 12 h.

What the model lacks lasts for hours, and the PLC answers it; with a higher worth the fit would take the vents'
answer to a missing heat flux for vents without effect (feedback bias)."""
_SAMPLE = 1800.0
"""Seconds between residuals that are kept of a run."""


def calibrate(
    parts: Record | Sequence[tuple[Record, NDArray[np.bool_] | None]],
    knowledge: Posterior,
    effects: ActiveEffects,
    *,
    hours: float = 24.0,
    every_hours: float = 12.0,
    step: float = 900.0,
    iterations: int = 12,
    start: Mapping[str, float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Posterior:
    """Return the parameters' posterior given logs.

    Args:
        parts: a record, or several with the rows that may be used (None: all); several compartments of one kind
            are fitted with one set of parameters.
        knowledge: the prior; its names are the parameters, all of them.
        effects: the active effects, held.
        hours: length of the free runs.
        every_hours: between their starts.
        step: seconds; records of shorter steps are run at this one, which is several times as fast.
        iterations: at most.
        start: where the search starts, by name (None: the prior's mean).
        progress: is told of each iteration in a line.

    Raises:
        IgrowError: no complete run lies within the rows.
    """
    runs = []
    for fine, rows in [(parts, None)] if isinstance(parts, Record) else parts:
        factor = max(1, int(step // fine.step))
        record = fine.coarser(factor)
        allowed = np.ones(len(record), dtype=bool) if rows is None else coarser_rows(rows, factor)
        steps = max(1, round(hours * 3600.0 / record.step))
        starts = starts_within(record, allowed, steps, max(1, round(every_hours * 3600.0 / record.step)))
        if len(starts):
            first = max(0, int(starts[0]) - round(5 * 86_400.0 / record.step))
            runs.append((record.slice(first, int(starts[-1]) + steps + 1), starts - first, steps))
    if not runs:
        raise IgrowError(f"no stretch of {hours:g} h of the log is complete enough to calibrate on")
    names = knowledge.names

    def residuals(points: Floats) -> dict[str, Floats]:
        return _residuals(runs, {name: points[:, k : k + 1] for k, name in enumerate(names)}, effects)

    def tell(iteration: int, errors: Mapping[str, Floats]) -> None:
        if progress is not None:
            sizes = ", ".join(f"{name} {float(np.nanmean(np.abs(values))):.3g}" for name, values in errors.items())
            progress(f"calibration step {iteration}: mean error of {hours:g} h runs: {sizes}")

    problem = Problem(
        residuals,
        {name: Scale(spread, _WORTH) for name, spread in _SPREADS.items()},
        knowledge.mean,
        knowledge.covariance,
        np.array([PARAMETERS[name].low for name in names]),
        np.array([PARAMETERS[name].high for name in names]),
    )
    begin = knowledge.mean if start is None else np.array([start[name] for name in names])
    point, errors = minimise(problem, begin, iterations, tell)
    # What the data are worth is only known at the end, when the residuals are those of the fitted model.
    scales = {name: observed_scale(values[0], 0.2 * _SPREADS[name]) for name, values in errors.items()}
    return Posterior(names, point, covariance(problem, point, errors, scales))


def coarser_rows(rows: NDArray[np.bool_], factor: int) -> NDArray[np.bool_]:
    """Return which rows of a coarser record are made of allowed rows only."""
    whole = len(rows) // factor * factor
    coarse: NDArray[np.bool_] = np.asarray(rows[:whole].reshape(-1, factor).all(axis=1))
    return coarse


def _residuals(
    runs: Sequence[tuple[Record, NDArray[np.int64], int]], parameters: Mapping[str, Floats], effects: ActiveEffects
) -> dict[str, Floats]:
    """Return residuals by quantity, (m, samples of a run, runs)."""
    collected: dict[str, list[Floats]] = {name: [] for name in PREDICTED}
    for record, starts, steps in runs:
        states = records.observe(record, parameters, effects)
        shown = records.free_run(record, states, starts, steps, parameters, effects)
        every = max(1, round(_SAMPLE / record.step))
        kept = np.arange(every - 1, steps, every)
        for name, predicted in shown.items():
            if name == "air_co2" and "co2_dosing" in record.unknown:
                continue  # Without the dose the CO2 would teach a greenhouse that is too tight.
            measured = record.measured[name][starts + 1 + kept[:, None]]
            if np.isfinite(measured).any():
                collected[name].append(np.moveaxis(predicted[kept], 0, 1) - measured)
    return {name: np.concatenate(parts, axis=2) for name, parts in collected.items() if parts}
