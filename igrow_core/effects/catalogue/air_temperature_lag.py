"""A temperature sensor that follows the air late."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values, lagged


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    return {"air_temperature": parameters["share"] * (memory - drivers["air_temperature"])}


EFFECT = Effect(
    name="air_temperature_lag",
    kind="sensor",
    balances=(),
    drivers=("air_temperature",),
    parameters=(
        Parameter("share", "1", 1.0, 0.0, 1.3, "share of the reading that lags"),
        Parameter("time_constant", "min", 15.0, 3.0, 90.0, "time by which the sensor lags"),
    ),
    contribution=_contribution,
    signature="the reading is behind in every change, no balance answers",
    separating_test="breathe on the sensor, or clean its filter and fan",
    title="a temperature sensor that answers late",
    sentence="the temperature sensor answers late",
    source="sensor practice",
    memory=lagged(lambda _xp, drivers: drivers["air_temperature"], "time_constant", 60.0),
    measured=("air_temperature",),
)
