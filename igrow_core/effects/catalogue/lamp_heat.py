"""Heat of the lamps beyond the share that the model counts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"heat": parameters["share"] * drivers["lamp_power"]}


EFFECT = Effect(
    name="lamp_heat",
    kind="process",
    balances=("heat",),
    drivers=("lamp_power",),
    parameters=(
        Parameter(
            "share",
            "1",
            0.2,
            -0.6,
            0.6,
            "share of the electric power that reaches the air as heat, beyond the model's",
        ),
    ),
    contribution=_contribution,
    signature="a square wave of heat with the lamps",
    separating_test="flash the lamps off schedule for an hour at night",
    title="lamps that heat the air more or less than thought",
    sentence="the lamps heat the air differently than expected: {value} of their power more",
    opposite="the lamps heat the air less than expected: {value} of their power less",
    source="Katzin et al. (2020), Biosystems Engineering 194: energy balance of lamps",
    resembles=("lamp_heat_share",),
)
