"""Photosynthesis that declines with time (ageing, disease)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    return {"assimilation": -0.01 * parameters["loss"] * drivers["elapsed_days"] * drivers["assimilation"]}


EFFECT = Effect(
    name="photosynthesis_decline",
    kind="process",
    balances=("co2", "growth"),
    drivers=("elapsed_days", "assimilation"),
    parameters=(Parameter("loss", "(100 d)-1", 0.3, -0.5, 3.0, "fraction of assimilation lost after 100 days"),),
    contribution=_contribution,
    signature="the uptake of CO2 falls slowly, in the light only",
    separating_test="measure the photosynthesis of a leaf",
    title="a crop that assimilates less from week to week",
    sentence="the crop assimilates less from week to week: {value} less in 100 days",
    opposite="the crop assimilates more from week to week: {value} more in 100 days",
    source="general practice: ageing and disease of a canopy",
)
