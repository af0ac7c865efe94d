"""CO2 that soil and substrate respire, litter on them included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values, lagged


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    return {"co2": parameters["rate"] / 3.6e6 * xp.exp(0.06931471805599453 * (memory - 20.0))}


EFFECT = Effect(
    name="soil_respiration",
    kind="process",
    balances=("co2",),
    drivers=("air_temperature",),
    parameters=(
        Parameter("rate", "g m-2 h-1", 0.5, 0.0, 10.0, "CO2 respired at 20 degC"),
        Parameter("time_constant", "h", 24.0, 6.0, 96.0, "time in which the soil follows the air"),
    ),
    contribution=_contribution,
    signature="CO2 rises at night with the temperature of the soil",
    separating_test="a cup over the substrate and a CO2 sensor",
    title="CO2 from the soil",
    sentence="the soil, or leaves that rot on it, gives off CO2: about {value} g/m2 per hour at 20 degC",
    source="Lloyd and Taylor (1994), Funct. Ecol. 8; Q10 of 2",
    memory=lagged(lambda _xp, drivers: drivers["air_temperature"], "time_constant", 3600.0),
    resembles=("respiration",),
)
