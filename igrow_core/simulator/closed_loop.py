"""Runs of climate and actuation stage together: from setpoints and weather to climate, energy and CO2 used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from igrow.core.arrays import Array, Floats, Integers
from igrow.core.effects.definition import Values
from igrow.core.namespace import FloatNamespace
from igrow.core.simulator import actuation
from igrow.core.simulator.hybrid import climate, measurement
from igrow.core.simulator.hybrid.climate import ActiveEffects
from igrow.core.simulator.hybrid.record import SUBSTEP, Record


def closed_run(
    record: Record,
    states: Mapping[str, Floats],
    setpoints: Mapping[str, Floats],
    starts: Sequence[int] | Integers,
    steps: int,
    parameters: Values,
    effects: ActiveEffects,
    rules: Values,
    added: Mapping[str, Floats] | None = None,
) -> dict[str, Floats]:
    """Run both stages freely from several instants of a record, driven by its weather and setpoints.

    Args:
        record: with n rows; its actuators are used at the starts only.
        states: from `record.observe`, (n,) each.
        setpoints: by name, (n,).
        starts: rows to start from, (s,).
        steps: rows to run.
        parameters: of the climate stage.
        effects: the active effects.
        rules: of the actuation stage; floats, or (m, 1) for m variants at once.
        added: further fluxes by channel, (n,) or (steps, s).

    Returns:
        At rows start + 1 ... start + steps, (steps, s) or (steps, m, s): what the sensors would show
        (`measurement.PREDICTED`); and over the step before, `actuation.OUTPUTS`, ``heat`` of the pipes (W m-2) and
        ``ventilation`` (m s-1).
    """
    begin = np.asarray(starts, dtype=np.int64)
    rows = begin + np.arange(steps)[:, None]
    substeps = max(1, round(record.step / SUBSTEP))
    seconds = record.step / substeps
    varied = (*parameters.values(), *rules.values(), *(value for one in effects.values() for value in one.values()))
    # Floats are several times as fast as arrays of one element.
    single = len(begin) == 1 and not any(np.ndim(value) for value in varied)
    xp: Any = FloatNamespace if single else np

    def courses(columns: Mapping[str, Floats]) -> Mapping[str, Array]:
        """Return what each of the runs reads at each step, by name."""
        of_runs = {name: values[rows] if values.ndim == 1 else values for name, values in columns.items()}
        return {name: values[:, 0].tolist() if single else values for name, values in of_runs.items()}

    def at(columns: Mapping[str, Array], step: int) -> dict[str, Array]:
        return {name: values[step] for name, values in columns.items()}

    outside, asked, further = courses(record.inputs), courses(setpoints), courses(added or {})
    state: dict[str, Array] = {
        name: float(values[begin[0]]) if single else values[begin] for name, values in states.items()
    }
    actuators = {name: outside[name][0] for name in actuation.OUTPUTS}
    position = {name: outside[name][0] for name in actuation.POSITIONS}
    shown: dict[str, list[Array]] = {}
    for k in range(steps):
        inputs, fluxes = at(outside, k), at(further, k)
        drivers: Mapping[str, Array] = {}
        for _ in range(substeps):
            drivers = climate.derive(xp, state, inputs | actuators, parameters, record.lamp_efficacy)
            sensed = dict(drivers) | measurement.measured(xp, drivers, state, effects)
            actuators = actuation.act(xp, at(asked, k), inputs, sensed, position, rules, seconds=seconds)
            position = {name: actuators[name] for name in actuation.POSITIONS}
            state = climate.advance(
                xp,
                state,
                inputs | actuators,
                parameters,
                effects,
                seconds=seconds,
                lamp_efficacy=record.lamp_efficacy,
                added=fluxes,
            )
        after = climate.derive(xp, state, inputs | actuators, parameters, record.lamp_efficacy)
        row_result = measurement.measured(xp, after, state, effects) | actuators
        row_result["heat"] = pipe_heat(drivers, parameters)
        row_result["ventilation"] = after["ventilation"]
        for name, values in row_result.items():
            shown.setdefault(name, []).append(values)
    if single:
        return {name: np.array(values)[:, None] for name, values in shown.items()}
    return {name: np.stack(np.broadcast_arrays(*values)) for name, values in shown.items()}


def pipe_heat(drivers: Values, parameters: Values) -> Array:
    """Return the heat that the pipes give to the air, W m-2."""
    return (
        parameters["rail_pipe_heat_transfer"] * drivers["rail_pipe_excess"]
        + parameters["grow_pipe_heat_transfer"] * drivers["grow_pipe_excess"]
    )
