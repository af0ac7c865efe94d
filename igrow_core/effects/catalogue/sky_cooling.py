"""Long-wave radiation to a clear sky beyond what the cover coefficient holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Effect, Parameter, Values


def _contribution(xp: Any, drivers: Drivers, parameters: Values, _memory: Array) -> Mapping[str, Array]:
    open_share = (1.0 - 0.006 * drivers["energy_screen"]) * (1.0 - 0.008 * drivers["blackout_screen"])
    return {
        "heat": -parameters["exchange"] * open_share * (drivers["outdoor_temperature"] - drivers["sky_temperature"])
    }


EFFECT = Effect(
    name="sky_cooling",
    kind="process",
    balances=("heat",),
    drivers=("outdoor_temperature", "sky_temperature", "energy_screen", "blackout_screen"),
    parameters=(Parameter("exchange", "W m-2 K-1", 0.7, 0.0, 6.0, "heat lost per kelvin between outdoor air and sky"),),
    contribution=_contribution,
    signature="heat is lost on clear nights, not on overcast ones, less under a screen",
    separating_test="compare a clear with an overcast night of the same outdoor temperature and wind",
    title="more heat lost to a clear sky",
    sentence=(
        "clear nights cost more heat than expected: about {value} W/m2 for each kelvin that the sky is "
        "colder than the air outside"
    ),
    source="Vanthoor (2011), electronic appendix: long-wave exchange of the cover with the sky",
    resembles=("sky_share",),
)
