"""A pipe sensor that reads too much by a constant while the circuit is warm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    rail = parameters["offset"] * xp.tanh(0.5 * drivers["rail_pipe_excess"])
    grow = parameters["offset"] * xp.tanh(0.5 * drivers["grow_pipe_excess"])
    return {"rail_pipe_temperature": rail, "grow_pipe_temperature": grow}


EFFECT = Effect(
    name="pipe_temperature_offset",
    kind="sensor",
    balances=(),
    drivers=("rail_pipe_excess", "grow_pipe_excess"),
    parameters=(Parameter("offset", "K", 4.0, -20.0, 20.0, "what the sensors read too much"),),
    contribution=_contribution,
    signature="the heat of a warm pipe is off by a constant, whatever its temperature",
    separating_test="hold a contact thermometer to the pipe",
    title="pipe temperature sensors that are off",
    sentence="the pipe temperature sensors read {value} {unit} too much",
    opposite="the pipe temperature sensors read {value} {unit} too little",
    source="sensor practice",
    measured=("rail_pipe_temperature", "grow_pipe_temperature"),
)
