"""CO2 that a closed dosing valve lets through."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"co2": parameters["rate"] / 3.6e6 + 0.0 * drivers["air_co2"]}


EFFECT = Effect(
    name="co2_valve_leak",
    kind="process",
    balances=("co2",),
    drivers=("air_co2",),
    parameters=(Parameter("rate", "g m-2 h-1", 0.5, 0.0, 10.0, "CO2 that leaks in all the time"),),
    contribution=_contribution,
    signature="CO2 stays high on nights with the dosing off",
    separating_test="close the hand valve of the CO2 line for a night",
    title="a CO2 valve that leaks",
    sentence="CO2 leaks in all the time: about {value} g/m2 per hour",
    source="mass balance",
)
