"""Ventilation that depends on the direction of the wind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    angle = (drivers["wind_direction"] - parameters["direction"]) * 0.017453292519943295
    opening = 0.005 * (drivers["vent_lee"] + drivers["vent_wind"])
    return {"air_exchange": parameters["exchange"] * opening * drivers["wind_speed"] * xp.cos(angle)}


EFFECT = Effect(
    name="vent_wind_asymmetry",
    kind="process",
    balances=("heat", "vapour", "co2"),
    drivers=("wind_direction", "wind_speed", "vent_lee", "vent_wind"),
    parameters=(
        Parameter(
            "exchange",
            "1",
            0.004,
            0.0,
            0.03,
            "air exchange per floor area for open vents at 1 m/s of wind from the worst side",
        ),
        Parameter("direction", "deg", 225.0, 0.0, 360.0, "wind direction with the strongest exchange"),
    ),
    contribution=_contribution,
    signature="ventilation is more from one side and less from the other, vents open",
    separating_test="compare hours of equal wind speed from two opposite directions with the vents at the same opening",
    title="vents that exchange more air in wind from one side",
    sentence="the vents exchange more air when the wind comes from one side (strength {value})",
    source="De Jong (1990), thesis Wageningen: window aspect and wind direction",
)
