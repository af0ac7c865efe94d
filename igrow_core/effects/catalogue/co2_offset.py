"""A CO2 sensor that reads too much by a constant."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_co2": parameters["offset"] + 0.0 * drivers["air_co2"]}


EFFECT = Effect(
    name="co2_offset",
    kind="sensor",
    balances=(),
    drivers=("air_co2",),
    parameters=(Parameter("offset", "ppm", 40.0, -400.0, 400.0, "what the sensor reads too much"),),
    contribution=_contribution,
    signature="the reading is off from one moment on, no balance answers",
    separating_test="hold a calibrated hand sensor beside it",
    title="a CO2 sensor that is off",
    sentence="the CO2 sensor reads {value} ppm too much",
    opposite="the CO2 sensor reads {value} ppm too little",
    source="sensor practice",
    measured=("air_co2",),
)
