"""Transpiration that follows the leaf area more than the model's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    vapour = (
        parameters["slope"] * drivers["transpiration"] * (drivers["leaf_area_index"] / parameters["reference"] - 1.0)
    )
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


EFFECT = Effect(
    name="leaf_area_transpiration",
    kind="process",
    balances=("vapour", "heat"),
    drivers=("leaf_area_index", "transpiration"),
    parameters=(
        Parameter(
            "slope",
            "1",
            0.5,
            -2.0,
            2.0,
            "relative change of transpiration for a relative change of leaf area",
        ),
        Parameter("reference", "m2 m-2", 3.0, 1.0, 5.0, "leaf area at which the model is right"),
    ),
    contribution=_contribution,
    signature="transpiration steps on the days of deleafing",
    separating_test="compare the day before and after deleafing",
    title="transpiration that follows the leaf area more",
    sentence="transpiration follows the leaf area more than expected ({value})",
    opposite="transpiration follows the leaf area less than expected ({value})",
    source="Stanghellini (1987), thesis Wageningen: transpiration per leaf area",
)
