"""Runs of climate and actuation stage together: from setpoints and weather to climate, energy and CO2 used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from igrow.core.arrays import Array, Floats, Integers
from igrow.core.effects.definition import Values
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
    substeps = max(1, round(record.step / SUBSTEP))
    seconds = record.step / substeps
    state: dict[str, Array] = {name: values[begin] for name, values in states.items()}
    position: dict[str, Array] = {name: record.inputs[name][begin] for name in actuation.POSITIONS}
    actuators = {name: record.inputs[name][begin] for name in actuation.OUTPUTS}
    shown: dict[str, list[Floats]] = {}
    for k in range(steps):
        row = begin + k
        inputs: dict[str, Array] = {name: values[row] for name, values in record.inputs.items()}
        asked = {name: values[row] for name, values in setpoints.items()}
        fluxes = {channel: flux[row] if flux.ndim == 1 else flux[k] for channel, flux in (added or {}).items()}
        drivers: Mapping[str, Array] = {}
        for _ in range(substeps):
            drivers = climate.derive(np, state, inputs | actuators, parameters, record.lamp_efficacy)
            sensed = dict(drivers) | measurement.measured(np, drivers, state, effects)
            actuators = actuation.act(np, asked, inputs, sensed, position, rules, seconds=seconds)
            position = {name: actuators[name] for name in actuation.POSITIONS}
            state = climate.advance(
                np,
                state,
                inputs | actuators,
                parameters,
                effects,
                seconds=seconds,
                lamp_efficacy=record.lamp_efficacy,
                added=fluxes,
            )
        after = climate.derive(np, state, inputs | actuators, parameters, record.lamp_efficacy)
        row_result = measurement.measured(np, after, state, effects) | actuators
        row_result["heat"] = pipe_heat(drivers, parameters)
        row_result["ventilation"] = after["ventilation"]
        for name, values in row_result.items():
            shown.setdefault(name, []).append(values)
    return {name: np.stack(np.broadcast_arrays(*values)) for name, values in shown.items()}


def pipe_heat(drivers: Values, parameters: Values) -> Array:
    """Return the heat that the pipes give to the air, W m-2."""
    return (
        parameters["rail_pipe_heat_transfer"] * drivers["rail_pipe_excess"]
        + parameters["grow_pipe_heat_transfer"] * drivers["grow_pipe_excess"]
    )
