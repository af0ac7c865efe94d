"""A structure that shades the greenhouse at one position of the sun."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    distance = (drivers["sun_azimuth"] - parameters["azimuth"]) / parameters["width"]
    return {"light_loss": parameters["loss"] * xp.exp(-distance * distance)}


EFFECT = Effect(
    name="structure_shade",
    kind="process",
    balances=("light", "heat"),
    drivers=("sun_azimuth", "sun_elevation", "radiation_inside"),
    parameters=(
        Parameter("loss", "1", 0.25, 0.0, 1.0, "fraction of the light lost in the shade"),
        Parameter("azimuth", "deg", 140.0, 60.0, 300.0, "azimuth of the sun in the middle of the shade"),
        Parameter("width", "deg", 20.0, 8.0, 60.0, "half width of the shade"),
    ),
    contribution=_contribution,
    signature="light is missing at a fixed hour of clear days",
    separating_test="look at the shadow at that hour; hold a light meter below the cover there",
    title="a shadow at a fixed hour",
    sentence="something shades the greenhouse at a fixed hour: {value} of the light is missing then",
    source="geometry of direct light",
)
