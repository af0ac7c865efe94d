"""A cover that lets through less light from a low sun."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    height = xp.sin(xp.maximum(drivers["sun_elevation"], 0.0 * drivers["sun_elevation"]) * 0.017453292519943295)
    return {"light_loss": parameters["loss"] * (1.0 - height) ** parameters["exponent"]}


EFFECT = Effect(
    name="angle_transmission",
    kind="process",
    balances=("light", "heat"),
    drivers=("sun_elevation", "radiation_inside"),
    parameters=(
        Parameter("loss", "1", 0.25, 0.0, 0.9, "fraction of the light lost when the sun stands at the horizon"),
        Parameter("exponent", "1", 2.0, 1.0, 6.0, "how fast the loss fades with the height of the sun"),
    ),
    contribution=_contribution,
    signature="light is missing in the morning, the evening and in winter alike",
    separating_test="compare the light below the cover at noon and at 20 degrees of sun height",
    title="less light from a low sun",
    sentence="a low sun gives less light than expected: {value} less at the horizon",
    source="Bot (1983), thesis Wageningen: angular transmission of covers",
)
