"""Dosed CO2 that leaves through open vents before it mixes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    opening = 0.005 * (drivers["vent_lee"] + drivers["vent_wind"])
    return {"co2": -parameters["share"] * opening * drivers["co2_dosing"] / 3600.0}


EFFECT = Effect(
    name="co2_dose_vent_loss",
    kind="process",
    balances=("co2",),
    drivers=("co2_dosing", "vent_lee", "vent_wind"),
    parameters=(Parameter("share", "1", 1.0, 0.0, 4.0, "share of the dose lost at fully open vents"),),
    contribution=_contribution,
    signature="CO2 is missing while it is dosed with the vents open",
    separating_test="stop dosing for an hour with the vents open, and compare",
    title="dosed CO2 that escapes through open vents",
    sentence="dosed CO2 escapes through open vents before it mixes: {value} of it at fully open vents",
    source="short circuit of the flow, mass balance",
)
