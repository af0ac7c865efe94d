"""Vapour that condenses on the inside of a cold cover."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.air import saturation_concentration
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    cover = drivers["outdoor_temperature"] + parameters["cover_share"] * (
        drivers["air_temperature"] - drivers["outdoor_temperature"]
    )
    excess = drivers["vapour_concentration"] - saturation_concentration(xp, cover)
    return {"vapour": -parameters["transfer"] * xp.maximum(excess, 0.0 * excess)}


EFFECT = Effect(
    name="cover_condensation",
    kind="process",
    balances=("vapour",),
    drivers=("air_temperature", "outdoor_temperature", "vapour_concentration"),
    parameters=(
        Parameter("transfer", "m s-1", 0.001, 0.0, 0.02, "mass transfer coefficient of the cover"),
        Parameter(
            "cover_share",
            "1",
            0.35,
            0.1,
            0.7,
            "where the cover temperature lies between outdoor (0) and indoor air (1)",
        ),
    ),
    contribution=_contribution,
    signature=(
        "vapour vanishes when it is cold outside and humid inside, and the loss saturates: none below the "
        "dew point of the cover"
    ),
    separating_test="watch the cover at dawn; compare a cold with a mild night of the same humidity",
    title="more water that condenses on the cover",
    sentence="more water condenses on the cold cover than expected (transfer {value} {unit})",
    source="Stanghellini and de Jong (1995), Agric. For. Meteorol. 76: condensation on the cover",
    resembles=("condensation_transfer",),
)
