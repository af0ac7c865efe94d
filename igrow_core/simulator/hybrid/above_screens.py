"""The air above the screens: what leaves through vents and cover leaves from there.

It holds little, so that it follows at once what is below it and outside: a second zone without states of its own
(Vanthoor 2011, electronic appendix, sections 3 and 8, where it has them). Screens are a resistance between both airs,
in series with vents and cover; where none is drawn, both airs are one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core import air
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Values

_OPEN_FLOW = 0.2
"""Flow between the air below and above screens that are not drawn, m s-1: so much that both are one."""
_LOW_LEAKS = 0.5
"""Share of the leaks that lies below the screens (Vanthoor 2011, electronic appendix, section 8)."""


def forcing_above(
    xp: Any, screens: Array, surroundings: Array, inputs: Drivers, parameters: Values
) -> dict[str, Array]:
    """Return what `drivers_above` reads and no state changes; arguments as its own."""
    # De Jong (1990): the flow past lee vents saturates with the opening, that past windward vents does not.
    lee = 0.01 * inputs["vent_lee"]
    lee = lee * (1.0 + parameters["vent_curvature"] * (1.0 - lee))
    opening = lee + 0.01 * parameters["vent_windward_ratio"] * inputs["vent_wind"]
    wind = inputs["wind_speed"]
    leakage = (parameters["leakage_still"] + parameters["leakage_wind"] * wind) * inputs["mean_height"] / 3600.0
    cover = parameters["cover_heat_transfer"] + parameters["cover_wind_heat_transfer"] * wind
    closed = 0.01 * xp.maximum(inputs["energy_screen"], inputs["blackout_screen"])
    open_part = xp.maximum(1.0 - closed, 0.0 * closed)
    return {
        "half_opening": 0.5 * opening,
        "by_wind": parameters["vent_wind"] * wind,
        "leakage_below": _LOW_LEAKS * leakage,
        "leakage_above": (1.0 - _LOW_LEAKS) * leakage,
        "cover": cover,
        "unscreened": cover * screens,
        "screened": 1.0 - screens,
        "lost_to_surroundings": cover * surroundings,
        "cloth": closed / parameters["screen_air_resistance"],
        "past_open_part": _OPEN_FLOW * open_part * xp.sqrt(open_part + 1e-4),
    }


def drivers_above(
    xp: Any,
    temperature: Array,
    surroundings: Array,
    screens: Array,
    inputs: Drivers,
    parameters: Values,
    forcing: Mapping[str, Array],
) -> dict[str, Array]:
    """Return the exchange of air and heat past the screens, the vents, the leaks and the cover.

    Args:
        xp: the array namespace.
        temperature: of the air below, degC.
        surroundings: what the cover sees, degC.
        screens: share of the heat through the cover that they let pass.
        inputs: as `climate.derive`'s.
        parameters: by name.
        forcing: from `forcing_above`.
    """
    # How warm it is above the screens without vents tells how much rises through these.
    outdoor = inputs["outdoor_temperature"]
    still = surroundings + screens * (temperature - surroundings)
    buoyancy = xp.sqrt(xp.abs(still - outdoor) + 0.01)
    ventilation = forcing["half_opening"] * (forcing["by_wind"] + parameters["vent_stack"] * buoyancy)
    exchange_above = ventilation + forcing["leakage_above"]
    carried = air.VOLUMETRIC_HEAT * exchange_above
    unscreened, screened = forcing["unscreened"], forcing["screened"]
    pull = forcing["cover"] + screened * carried
    temperature_above = (
        unscreened * temperature + screened * (forcing["lost_to_surroundings"] + carried * outdoor)
    ) / pull
    # Through closed cloth and its gaps air passes with the two thirds power of the difference (Balemans 1989).
    colder = temperature - temperature_above
    past_cloth = forcing["cloth"] * xp.exp(xp.log(colder * colder + 0.04) / 3.0)
    return {
        "ventilation": ventilation,
        "exchange_below": forcing["leakage_below"],
        "exchange_above": exchange_above,
        "past_screens": past_cloth + forcing["past_open_part"],
        "cover_conductance": forcing["cover"],
        "temperature_above": temperature_above,
        "share_above": unscreened / pull,
    }


def exchanged(xp: Any, drivers: Drivers, added: Mapping[str, Array]) -> tuple[Array, Array]:
    """Return the exchange with outdoors, m s-1, of the air below the screens and of that above.

    What effects add is below; they may take from the exchange, but not more than there is.
    """
    low = drivers["exchange_below"] + added.get("air_exchange", 0.0)
    zero = 0.0 * low
    return xp.maximum(low, zero), xp.maximum(drivers["exchange_above"] + xp.minimum(low, zero), zero)


def condensing(xp: Any, state: Values, drivers: Drivers, parameters: Values, top: Array) -> tuple[Array, ...]:
    """Return how much more vapour than the cover bears the air above the screens would hold, kg m-3; the mass transfer
    to the cover, m s-1, where it is wet; and how fast what the cover bears rises with its temperature, kg m-3 K-1."""
    past = drivers["past_screens"]
    above = (past * state["vapour_concentration"] + top * drivers["outdoor_vapour_concentration"]) / (past + top)
    surroundings = drivers["surroundings"]
    cover = surroundings + parameters["cover_share"] * (drivers["temperature_above"] - surroundings)
    saturated = air.saturation_concentration(xp, cover)
    dew = above - saturated
    wet = xp.maximum(dew, 0.0 * dew)
    slope = saturated * (4283.6 / ((cover + 243.04) * (cover + 243.04)) - 1.0 / (cover + 273.15))
    return dew, parameters["condensation_transfer"] * wet / (wet + 1e-5), slope
