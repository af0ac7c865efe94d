"""Irrigation water that evaporates from slab and floor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values, lagged


def _contribution(xp: Any, drivers: Drivers, parameters: Values, memory: Array) -> Mapping[str, Array]:
    vapour = parameters["share"] * memory / 3600.0
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


EFFECT = Effect(
    name="irrigation_evaporation",
    kind="process",
    balances=("vapour", "heat"),
    drivers=("irrigation",),
    parameters=(
        Parameter("share", "1", 0.1, 0.0, 1.0, "share of the irrigation water that evaporates"),
        Parameter("time_constant", "min", 60.0, 10.0, 360.0, "time over which it does"),
    ),
    contribution=_contribution,
    signature="a pulse of vapour after each irrigation that decays within an hour or two",
    separating_test="skip one irrigation turn on a dull day",
    title="irrigation water that evaporates from the floor",
    sentence="irrigation water evaporates from the floor: {value} of it",
    source="mass balance of wet surfaces",
    memory=lagged(lambda _xp, drivers: drivers["irrigation"], "time_constant", 60.0, within_step=True),
)
