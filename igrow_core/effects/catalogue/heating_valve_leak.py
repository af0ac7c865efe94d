"""Hot water that a closed heating valve lets through."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    closed = 1.0 - xp.tanh(drivers["rail_pipe_excess"] / parameters["threshold"])
    return {"heat": parameters["heat"] * closed}


EFFECT = Effect(
    name="heating_valve_leak",
    kind="process",
    balances=("heat",),
    drivers=("rail_pipe_excess",),
    parameters=(
        Parameter("heat", "W m-2", 8.0, 0.0, 80.0, "heat released while the heating is off"),
        Parameter("threshold", "K", 3.0, 1.0, 10.0, "pipe excess below which the valve counts as closed"),
    ),
    contribution=_contribution,
    signature="heat comes in while the heating is off, day and night",
    separating_test="feel the pipe behind the closed valve; close the hand valve for a night",
    title="a heating valve that leaks",
    sentence="a closed heating valve lets hot water through: about {value} W/m2 while the heating is off",
    source="general practice: valve authority and leakage, EN 60534-4",
)
