"""Transpiration of the crop in the dark beyond the model's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    light = xp.maximum(drivers["global_radiation"] + drivers["lamp_power"], 0.0 * drivers["lamp_power"])
    dark = xp.exp(-light / 10.0)
    vapour = parameters["rate"] / 3.6e9 * drivers["vapour_deficit"] * drivers["leaf_area_index"] * dark
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


EFFECT = Effect(
    name="night_transpiration",
    kind="process",
    balances=("vapour", "heat"),
    drivers=("vapour_deficit", "leaf_area_index", "global_radiation", "lamp_power"),
    parameters=(
        Parameter(
            "rate",
            "g m-2 h-1 kPa-1",
            8.0,
            0.0,
            60.0,
            "water per leaf area and kilopascal of deficit in the dark",
        ),
    ),
    contribution=_contribution,
    signature="vapour appears in the dark only, with the deficit and the leaf area",
    separating_test="compare two dark nights of different humidity; switch the lamps on for an hour",
    title="a crop that evaporates more at night",
    sentence="the crop evaporates more at night than expected: {value} g/m2 of leaf per hour and kPa",
    source="Caird et al. (2007), Plant Physiol. 143: night-time transpiration",
    resembles=("transpiration_night_share",),
)
