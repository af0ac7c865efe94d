"""Ventilation by buoyancy, without wind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    opening = 0.005 * (drivers["vent_lee"] + drivers["vent_wind"])
    difference = xp.maximum(drivers["air_temperature"] - drivers["outdoor_temperature"], 0.01)
    return {"air_exchange": parameters["exchange"] * opening * xp.sqrt(difference)}


EFFECT = Effect(
    name="stack_ventilation",
    kind="process",
    balances=("heat", "vapour", "co2"),
    drivers=("vent_lee", "vent_wind", "air_temperature", "outdoor_temperature"),
    parameters=(
        Parameter(
            "exchange",
            "m s-1 K-0.5",
            0.002,
            0.0,
            0.02,
            "air exchange of the open vents for 1 K of difference to outside",
        ),
    ),
    contribution=_contribution,
    signature="open vents exchange more air on windless days when it is much warmer inside",
    separating_test="open the vents to 10 % in a calm hour and compare with a windy hour",
    title="open vents that exchange more air in calm weather",
    sentence="open vents exchange more air on calm days than expected ({value} m/s per root kelvin)",
    source="Boulard and Baille (1995), J. Agric. Eng. Res. 61: stack effect",
    resembles=("vent_stack",),
)
