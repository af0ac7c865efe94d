"""Photosynthesis that suffers from heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    excess = xp.maximum(drivers["air_temperature"] - parameters["threshold"], 0.0 * drivers["air_temperature"])
    return {"assimilation": -0.1 * parameters["loss"] * excess * drivers["assimilation"]}


EFFECT = Effect(
    name="photosynthesis_heat_limit",
    kind="process",
    balances=("co2", "growth"),
    drivers=("air_temperature", "assimilation"),
    parameters=(
        Parameter(
            "loss",
            "(10 K)-1",
            0.8,
            0.0,
            4.0,
            "fraction of assimilation lost for ten kelvin above the threshold",
        ),
        Parameter("threshold", "degC", 26.0, 22.0, 34.0, "air temperature at which it begins"),
    ),
    contribution=_contribution,
    signature="CO2 stays high on hot noons",
    separating_test="shade or ventilate more for one hot noon and compare",
    title="a crop that assimilates less in heat",
    sentence="the crop assimilates less in heat: {value} less for 10 K too much",
    source="Farquhar et al. (1980), Planta 149: temperature response",
)
