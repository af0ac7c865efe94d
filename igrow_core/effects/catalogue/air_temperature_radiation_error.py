"""A temperature sensor that the sun warms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"air_temperature": 0.01 * parameters["error"] * drivers["radiation_inside"]}


EFFECT = Effect(
    name="air_temperature_radiation_error",
    kind="sensor",
    balances=(),
    drivers=("radiation_inside",),
    parameters=(Parameter("error", "K (100 W m-2)-1", 0.5, -3.0, 3.0, "error for each 100 W/m2 inside"),),
    contribution=_contribution,
    signature="the reading follows the light at once, no balance answers",
    separating_test="shade and ventilate the sensor box for a sunny hour",
    title="a temperature sensor that the sun warms",
    sentence="the sun warms the temperature sensor: it reads {value} K too much for each 100 W/m2",
    opposite="the temperature sensor reads too little in the sun: {value} K for each 100 W/m2",
    source="sensor practice",
    measured=("air_temperature",),
)
