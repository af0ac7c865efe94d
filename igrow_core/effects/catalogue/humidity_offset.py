"""A humidity sensor that reads too much by a constant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_humidity": parameters["offset"] + 0.0 * drivers["air_humidity"]}


EFFECT = Effect(
    name="humidity_offset",
    kind="sensor",
    balances=(),
    drivers=("air_humidity",),
    parameters=(Parameter("offset", "%", 4.0, -30.0, 30.0, "what the sensor reads too much"),),
    contribution=_contribution,
    signature="the reading is off from one moment on, no balance answers",
    separating_test="hold a calibrated hand sensor beside it",
    title="a humidity sensor that is off",
    sentence="the humidity sensor reads {value} % too much",
    opposite="the humidity sensor reads {value} % too little",
    source="sensor practice",
    measured=("air_humidity",),
)
