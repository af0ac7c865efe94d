"""The measurement path of the hybrid simulator: where a sensor fault is corrected, never in the plant."""

from __future__ import annotations

from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects import EFFECTS
from igrow.core.effects.definition import Drivers, Values
from igrow.core.simulator.hybrid.climate import ActiveEffects, memory_name

PREDICTED = ("air_temperature", "air_humidity", "air_co2")
"""What the climate stage predicts and a log measures."""
BEGINNING = (*PREDICTED, "mean_air_temperature")
"""What a graph begins from: the measured climate, and the air's mean temperature of the day before, degC, which floor
and soil are taken to have."""


def sensor_errors(xp: Any, drivers: Drivers, state: Values, effects: ActiveEffects) -> dict[str, Array]:
    """Return the error of each falsified measurement, by quantity, in its unit.

    Args:
        xp: the array namespace.
        drivers: from `climate.derive`.
        state: holds the memories of the active effects.
        effects: the active effects; process effects are passed over.
    """
    errors: dict[str, Array] = {}
    for name, values in effects.items():
        effect = EFFECTS[name]
        if effect.kind == "sensor":
            memory = state[memory_name(name)] if effect.memory else None
            for quantity, error in effect.contribution(xp, drivers, values, memory).items():
                errors[quantity] = errors[quantity] + error if quantity in errors else error
    return errors


def measured(xp: Any, drivers: Drivers, state: Values, effects: ActiveEffects) -> dict[str, Array]:
    """Return what the sensors would show for `PREDICTED`, faults included."""
    errors = sensor_errors(xp, drivers, state, effects)
    return {name: drivers[name] + errors[name] if name in errors else drivers[name] for name in PREDICTED}


def correct_inputs(xp: Any, inputs: Drivers, drivers: Drivers, state: Values, effects: ActiveEffects) -> Drivers:
    """Return the inputs without the errors of the sensors that measured them (pipes)."""
    errors = sensor_errors(xp, drivers, state, effects)
    return {name: value - errors[name] if name in errors else value for name, value in inputs.items()}
