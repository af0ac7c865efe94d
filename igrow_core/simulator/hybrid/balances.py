"""The balances of heat, vapour and CO2 of a greenhouse's air, and of the heat of floor and soil."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from igrow.core import air
from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Values
from igrow.core.simulator.hybrid.above_screens import condensing, exchanged
from igrow.core.simulator.hybrid.canopy import PASCAL_PER_CONTENT, drying

STATES = ("air_temperature", "vapour_concentration", "co2_concentration", "mass_temperature", "soil_temperature")
"""The states without the memories of effects: degC, kg m-3, kg m-3, and degC of floor and soil."""

_SOIL_HEAT_CAPACITY = 5e5
"""J m-2 K-1, of a quarter of a metre of moist soil, which follows within days (De Zwart 1996)."""
_LEAST_CO2 = 1e-6
"""kg m-3, half a part per million: less is a sensor that reads nothing, and must not divide."""
_SLOWEST = 1e-7
"""Rate at which a state is pulled back at least, s-1; in single precision a smaller one would be lost."""


@dataclass(frozen=True)
class Balances:
    """What moves each of `STATES`, and what pulls it back."""

    of: dict[str, tuple[Array, Array, Array]]
    """(Net flux, restoring conductance, capacity) by state: heat in W m-2, W m-2 K-1 and J m-2 K-1; vapour and CO2 in
    kg m-2 s-1, m s-1 and m."""
    moistened: Array
    """By how much more vapour warmer air is moistened, from the crop and by a cover that bears more, kg m-2 s-1 K-1."""


def balances(xp: Any, state: Values, drivers: Drivers, parameters: Values, added: Mapping[str, Array]) -> Balances:
    """Return the balances of each of `STATES`.

    Args:
        xp: the array namespace.
        state: `STATES` by name.
        drivers: from `climate.derive`.
        parameters: by name.
        added: what effects, a learned residual model or a disturbance add, by channel.
    """
    temperature, vapour, co2, mass, _ = (state[name] for name in STATES)
    height = drivers["mean_height"]
    outdoor = drivers["outdoor_temperature"]
    low, top = exchanged(xp, drivers, added)
    past = drivers["past_screens"]

    # Heat: through the cover and with the air that leaves above the screens, and with that which leaves below.
    temperature_above, cover = drivers["temperature_above"], drivers["cover_conductance"]
    rail = parameters["rail_pipe_heat_transfer"] * drivers["rail_pipe_excess"]
    grow = parameters["grow_pipe_heat_transfer"] * drivers["grow_pipe_excess"]
    affected = affected_drivers(xp, drivers, added)
    sun, transpiration = affected["radiation_inside"], affected["transpiration"]
    to_mass = parameters["mass_heat_transfer"] * (temperature - mass)
    dried = drying(xp, state, drivers)
    heat = (
        rail
        + grow
        + (parameters["lamp_heat_share"] + parameters["lamp_radiation_share"]) * drivers["lamp_power"]
        + parameters["solar_heat_share"] * sun
        - air.LATENT_HEAT * transpiration
        - cover * (temperature_above - drivers["surroundings"])
        - top * air.VOLUMETRIC_HEAT * (temperature_above - outdoor)
        - low * air.VOLUMETRIC_HEAT * (temperature - outdoor)
        - to_mass
        + added.get("heat", 0.0)
    )
    heat_conductance = (
        (cover + top * air.VOLUMETRIC_HEAT) * drivers["share_above"]
        + low * air.VOLUMETRIC_HEAT
        + parameters["mass_heat_transfer"]
        + parameters["rail_pipe_heat_transfer"] * xp.tanh(drivers["rail_pipe_excess"])
        + dried
    )

    # Vapour: what passes the screens leaves with the air, or condenses on the cover.
    outdoor_vapour = drivers["outdoor_vapour_concentration"]
    dew, wet, slope = condensing(xp, state, drivers, parameters, top)
    both = past + top
    condensation = wet * xp.maximum(dew, 0.0 * dew) * both / (both + wet)
    above = (past * vapour + top * outdoor_vapour - condensation) / both
    vapour_flux = transpiration - low * (vapour - outdoor_vapour) - past * (vapour - above) + added.get("vapour", 0.0)
    leaves = drivers["transpiration_response"] * (PASCAL_PER_CONTENT / air.LATENT_HEAT)
    vapour_conductance = low + past * (top + wet) / (both + wet) + leaves
    moistened = dried / air.LATENT_HEAT + past * wet / (both + wet) * slope * (
        parameters["cover_share"] * drivers["share_above"]
    )

    respiration = parameters["respiration"] / 3.6e6 * xp.exp(0.0693147 * (temperature - 20.0))
    exchange = low + past * top / both
    co2_flux = (
        parameters["dosing_share"] * drivers["co2_dosing"] / 3600.0
        - exchange * (co2 - drivers["outdoor_co2_concentration"])
        - affected["assimilation"]
        + respiration
        + added.get("co2", 0.0)
    )
    co2_conductance = exchange + 0.5 * drivers["assimilation"] / xp.maximum(co2, 0.0 * co2 + _LEAST_CO2)

    air_capacity = parameters["heat_capacity_factor"] * air.VOLUMETRIC_HEAT * height
    found = {
        "air_temperature": (heat, heat_conductance, air_capacity),
        "vapour_concentration": (vapour_flux, vapour_conductance, height),
        "co2_concentration": (co2_flux, co2_conductance, height),
        **below_the_air(state, sun, parameters),
    }
    # Without wind, vents, leaks and light nothing pulls CO2 back: its balance is then a plain sum.
    of = {
        name: (flux, xp.maximum(conductance, _SLOWEST * capacity), capacity)
        for name, (flux, conductance, capacity) in found.items()
    }
    return Balances(of, moistened)


def affected_drivers(xp: Any, drivers: Drivers, added: Mapping[str, Array]) -> dict[str, Array]:
    """Return the drivers of which effects take a part or to which they add: growth follows them as the air does.

    No effect takes more than there is, however long it goes on.

    Args:
        xp: the array namespace.
        drivers: from `climate.derive`.
        added: what effects add, by channel.

    Returns:
        ``radiation_inside`` (W m-2), ``par`` (umol m-2 s-1), ``transpiration`` and ``assimilation`` (kg m-2 s-1).
    """
    found = {name: drivers[name] for name in ("radiation_inside", "par", "transpiration", "assimilation")}
    if "light_loss" in added:
        light = xp.maximum(1.0 - added["light_loss"], 0.0 * added["light_loss"])
        of_par = 1.0 - (1.0 - light) * drivers["sun_share_of_par"]
        found = {
            "radiation_inside": found["radiation_inside"] * light,
            "par": found["par"] * of_par,
            "transpiration": found["transpiration"] - (1.0 - light) * drivers["sun_transpiration"],
            "assimilation": found["assimilation"] * of_par,
        }
    if "assimilation" in added:
        found["assimilation"] = xp.maximum(found["assimilation"] + added["assimilation"], 0.0 * found["assimilation"])
    return found


def below_the_air(state: Values, sun: Array, parameters: Values) -> dict[str, tuple[Array, Array, Array]]:
    """Return the balances of floor and soil, as `Balances.of`; nothing else of the air than its temperature moves them.

    Args:
        state: `STATES` by name, of which the temperatures are read.
        sun: radiation inside, W m-2.
        parameters: by name.
    """
    temperature, mass, soil = (state[name] for name in ("air_temperature", "mass_temperature", "soil_temperature"))
    above, below = parameters["mass_heat_transfer"], parameters["soil_heat_transfer"]
    to_soil = below * (mass - soil)
    mass_flux = above * (temperature - mass) + parameters["mass_solar_share"] * sun - to_soil
    return {
        "mass_temperature": (mass_flux, above + below, 1000.0 * parameters["mass_heat_capacity"]),
        "soil_temperature": (to_soil, below, _SOIL_HEAT_CAPACITY + 0.0 * mass),
    }
