"""Stomata that close in dry air."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    excess = xp.maximum(0.001 * drivers["vapour_deficit"] - parameters["threshold"], 0.0 * drivers["vapour_deficit"])
    vapour = -parameters["closure"] * excess * drivers["transpiration"]
    return {"vapour": vapour, "heat": -LATENT_HEAT * vapour}


EFFECT = Effect(
    name="deficit_stomata_closure",
    kind="process",
    balances=("vapour", "heat"),
    drivers=("vapour_deficit", "transpiration"),
    parameters=(
        Parameter(
            "closure",
            "kPa-1",
            0.4,
            0.0,
            2.0,
            "fraction of transpiration lost for each kilopascal above the threshold",
        ),
        Parameter("threshold", "kPa", 1.0, 0.4, 2.5, "deficit at which the stomata begin to close"),
    ),
    contribution=_contribution,
    signature="vapour is missing on hot dry noons only",
    separating_test="fog or shade for an hour at a dry noon and compare",
    title="a crop that closes its stomata in dry air",
    sentence="the crop closes its stomata in dry air: {value} of its transpiration for each kPa too much",
    source="Stanghellini (1987), thesis Wageningen: resistance against vapour deficit",
)
