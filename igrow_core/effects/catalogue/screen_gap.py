"""Air that passes a gap in the closed energy screen."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    exchange = parameters["exchange"] * 0.01 * drivers["energy_screen"]
    heat = -exchange * (drivers["air_temperature"] - drivers["outdoor_temperature"])
    vapour = -exchange / 1200.0 * (drivers["vapour_concentration"] - drivers["outdoor_vapour_concentration"])
    return {"heat": heat, "vapour": vapour}


EFFECT = Effect(
    name="screen_gap",
    kind="process",
    balances=("heat", "vapour"),
    drivers=(
        "energy_screen",
        "air_temperature",
        "outdoor_temperature",
        "vapour_concentration",
        "outdoor_vapour_concentration",
    ),
    parameters=(
        Parameter(
            "exchange",
            "W m-2 K-1",
            1.0,
            0.0,
            6.0,
            "heat exchanged per kelvin through the gap of the closed screen",
        ),
    ),
    contribution=_contribution,
    signature=(
        "heat and vapour are lost on nights under the screen, in proportion to the temperature difference, CO2 is not"
    ),
    separating_test="open and close the screen for half an hour on two nights alike; look at the edges of the screen",
    title="warm air that passes the closed screen",
    sentence=(
        "the closed screen lets warm air through: about {value} W/m2 more for each kelvin of difference to outside"
    ),
    source="Miguel et al. (1997), J. Agric. Eng. Res. 68: flow through screen openings",
    resembles=("energy_screen_saving",),
)
