"""The crop in the climate stage: how much it evaporates and takes up."""

from __future__ import annotations

from typing import Any

from igrow.core import air
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Values

PASCAL_PER_CONTENT = 1.36e5
"""Vapour pressure of a vapour content, Pa per kg m-3, at 20 degC."""
_STOMATA_HALF_OPEN = 6.0
"""Short-wave radiation at which the stomata of a canopy are half open, W m-2 (Stanghellini 1987: 3 for one leaf)."""
_CLOSING_DEFICIT = 1000.0
"""Deficit of the air at which a crop's conductance is half of that in moist air, Pa (Lohammar et al. 1980; Leuning
1995, Plant, Cell and Environment 18, 339-355)."""
_EXTINCTION = 0.7
"""Extinction of radiation in a tomato canopy (Stanghellini 1987)."""


def forcing_canopy(xp: Any, climate: Values, inputs: Drivers, parameters: Values) -> dict[str, Array]:
    """Return what `canopy_drivers` reads and no state changes.

    Args:
        xp: the array namespace.
        climate: light inside and ``screens``, as `climate.derive` returns them.
        inputs: as `climate.derive`'s.
        parameters: by name.
    """
    radiation_inside, par = climate["radiation_inside"], climate["par"]
    canopy = 1.0 - xp.exp(-_EXTINCTION * inputs["leaf_area_index"])
    of_radiation = parameters["transpiration_radiation"] * canopy
    radiation = radiation_inside + parameters["lamp_radiation_share"] * inputs["lamp_power"]
    night = parameters["transpiration_night_share"]
    day_share = night + (1.0 - night) * radiation / (radiation + _STOMATA_HALF_OPEN)
    long_wave = parameters["crop_long_wave_loss"] * climate["screens"]
    return {
        "of_radiation": of_radiation,
        "radiation": radiation,
        "in_moist_air": 0.001 * parameters["transpiration_moist_air"] * inputs["leaf_area_index"] * day_share,
        "long_wave": long_wave,
        "sun_transpiration": of_radiation * radiation_inside / air.LATENT_HEAT,
        "long_wave_response": of_radiation * long_wave,
        "assimilation_in_light": parameters["assimilation_maximum"]
        / 3.6e6
        * canopy
        * (par / (par + parameters["assimilation_light"])),
    }


def canopy_drivers(xp: Any, climate: Values, parameters: Values, forcing: Values) -> dict[str, Array]:
    """Return transpiration (kg m-2 s-1) and assimilation (kg m-2 s-1), and how they answer to the air.

    Args:
        xp: the array namespace.
        climate: air temperature, its deficit, CO2 and ``surroundings``, as `climate.derive` returns them.
        parameters: by name.
        forcing: from `forcing_canopy`.
    """
    temperature, deficit, ppm = climate["air_temperature"], climate["vapour_deficit"], climate["air_co2"]
    # Air that is just saturated is about to leave it: leaves answer to that, and to fog the less the thicker it is.
    fog = xp.maximum(climate["air_humidity"] - 100.0, 0.0 * deficit)
    # Stomata close as the air dries (Leuning 1995), so that a crop answers to drier air less than in proportion.
    open_share = _CLOSING_DEFICIT / (_CLOSING_DEFICIT + xp.maximum(deficit, 0.0 * deficit))
    response = forcing["in_moist_air"] * open_share
    # A crop that radiates to a cold cover is colder than the air, and evaporates less than the air's deficit says.
    lost = forcing["long_wave"] * (temperature - climate["surroundings"])
    evaporation = forcing["of_radiation"] * (forcing["radiation"] - lost) + response * deficit
    evaporation = xp.maximum(evaporation, 0.0 * temperature)
    return {
        "transpiration": evaporation / air.LATENT_HEAT,
        "sun_transpiration": forcing["sun_transpiration"],
        "transpiration_response": response * open_share / (1.0 + fog),
        "long_wave_response": forcing["long_wave_response"],
        "assimilation": forcing["assimilation_in_light"] * (ppm / (ppm + parameters["assimilation_co2"])),
    }


def drying(xp: Any, state: Values, drivers: Drivers) -> Array:
    """Return by how much more heat a crop evaporates for each kelvin of warmer, and so drier, air, W m-2 K-1."""
    temperature = state["air_temperature"]
    saturated = state["vapour_concentration"] * PASCAL_PER_CONTENT + drivers["vapour_deficit"]
    slope = saturated * 4283.6 / ((temperature + 243.04) * (temperature + 243.04))
    more = drivers["transpiration_response"] * slope - drivers["long_wave_response"]
    return xp.maximum(more, 0.0 * more)
