"""Heat that the soil takes up and returns over days."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values, lagged


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    return {"heat": parameters["exchange"] * (memory - drivers["air_temperature"])}


EFFECT = Effect(
    name="soil_heat_storage",
    kind="process",
    balances=("heat",),
    drivers=("air_temperature",),
    parameters=(
        Parameter("exchange", "W m-2 K-1", 2.0, 0.0, 12.0, "heat exchanged per kelvin with the soil"),
        Parameter("time_constant", "d", 4.0, 1.0, 12.0, "time in which the soil follows the air"),
    ),
    contribution=_contribution,
    signature="after a change of temperature heat flows the other way for three to six days",
    separating_test="hold the heating setpoint 2 K lower for one night and follow the heat use of the next three",
    title="heat that the soil stores for days",
    sentence="the soil stores heat for days: about {value} W/m2 for each kelvin between soil and air",
    source="Katzin et al. (2020), GreenLight: soil layers under the floor",
    memory=lagged(lambda _xp, drivers: drivers["air_temperature"], "time_constant", 86_400.0),
    resembles=("soil_heat_transfer",),
)
