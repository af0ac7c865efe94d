"""A temperature sensor that reads too much by a constant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_temperature": parameters["offset"] + 0.0 * drivers["air_temperature"]}


EFFECT = Effect(
    name="air_temperature_offset",
    kind="sensor",
    balances=(),
    drivers=("air_temperature",),
    parameters=(Parameter("offset", "K", 0.7, -6.0, 6.0, "what the sensor reads too much"),),
    contribution=_contribution,
    signature="the reading is off from one moment on, no balance answers",
    separating_test="hold a calibrated hand sensor beside it",
    title="a temperature sensor that is off",
    sentence="the temperature sensor reads {value} {unit} too much",
    opposite="the temperature sensor reads {value} {unit} too little",
    source="sensor practice",
    measured=("air_temperature",),
)
