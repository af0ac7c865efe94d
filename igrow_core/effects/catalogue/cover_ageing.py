"""A cover that lets through less light with time (dirt, ageing)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"light_loss": parameters["loss"] * 0.01 * drivers["elapsed_days"]}


EFFECT = Effect(
    name="cover_ageing",
    kind="process",
    balances=("light", "heat"),
    drivers=("elapsed_days", "radiation_inside"),
    parameters=(Parameter("loss", "(100 d)-1", 0.15, -0.3, 0.9, "fraction of the light lost after 100 days"),),
    contribution=_contribution,
    signature="a slow trend in the heat of the sun only",
    separating_test="wash one bay and compare the light below it",
    title="a cover that loses light",
    sentence="the cover loses light: {value} of it in 100 days",
    opposite="the cover lets more light through than it did: {value} more in 100 days",
    source="general practice: dirt and ageing of covers",
)
