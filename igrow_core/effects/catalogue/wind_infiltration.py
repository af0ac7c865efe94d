"""Outdoor air that the wind presses through gaps of the envelope."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    changes = parameters["air_changes"] * xp.maximum(drivers["wind_speed"], 0.01) ** parameters["exponent"]
    return {"air_exchange": changes * drivers["mean_height"] / 3600.0}


EFFECT = Effect(
    name="wind_infiltration",
    kind="process",
    balances=("heat", "vapour", "co2"),
    drivers=("wind_speed", "mean_height"),
    parameters=(
        Parameter("air_changes", "h-1 (m s-1)-1", 0.03, 0.0, 1.0, "air changes per hour for each m/s of wind"),
        Parameter("exponent", "1", 1.0, 0.5, 2.0, "power of the wind speed"),
    ),
    contribution=_contribution,
    signature="heat, vapour and CO2 leave together with the wind while the vents are shut",
    separating_test="compare a calm with a windy night, vents shut, CO2 dosing off",
    title="air that the wind presses in through gaps",
    sentence="more air leaks in when the wind blows: about {value} air changes per hour more for each m/s of wind",
    source="Vanthoor (2011), electronic appendix: leakage proportional to the wind speed",
    resembles=("leakage_wind",),
)
