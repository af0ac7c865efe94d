"""Rain that cools the cover."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"heat": -parameters["heat"] * drivers["rain"]}


EFFECT = Effect(
    name="rain_cooling",
    kind="process",
    balances=("heat",),
    drivers=("rain", "air_temperature", "outdoor_temperature"),
    parameters=(Parameter("heat", "W m-2", 20.0, 0.0, 150.0, "heat lost while it rains"),),
    contribution=_contribution,
    signature="heat is lost while it rains: rare and sharp",
    separating_test="compare the first hour of rain with the hour before",
    title="rain that cools the greenhouse",
    sentence="rain cools the greenhouse by about {value} W/m2",
    source="energy balance of a wet cover",
)
