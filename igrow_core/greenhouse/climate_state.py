"""What the climate is made of: its state, what acts on it during a step, and what crosses its boundary.

Bodies: air below the screens, air above them (top), canopy, cover, screen, floor, three soil layers over a deep
soil of constant temperature, pipe rail, grow pipe. Vapour and CO2 in both airs.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from igrow.core.air import SPECIFIC_HEAT_AIR, co2_concentration, vapour_concentration
from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters

AIR_HEAT = 1.2 * SPECIFIC_HEAT_AIR
"""Volumetric heat capacity of air, J m-3 K-1; constant, so that heat is conserved."""
SOIL_LAYERS = (0.08, 0.24, 0.72)
"""Thickness of the soil layers, m, doubling and more with depth as in Vanthoor (2011)."""


class Climate(NamedTuple):
    """The state: temperatures degC, contents kg m-3; floats or arrays (N,)."""

    air: Array
    top: Array
    canopy: Array
    cover: Array
    screen: Array
    floor: Array
    vapour: Array
    top_vapour: Array
    co2: Array
    top_co2: Array
    soil_1: Array
    soil_2: Array
    soil_3: Array
    rail: Array
    grow: Array


class Conditions(NamedTuple):
    """What acts on the climate during one step; W m-2, m s-1 and kg m-2 s-1 per floor area unless said."""

    outdoor_temperature: Array
    outdoor_vapour: Array
    outdoor_co2: Array
    wind_speed: Array
    sky_temperature: Array
    energy_closure: Array
    blackout_closure: Array
    vent_exchange: Array
    """Through the vents and half of the leaks, from the air above the screens, m s-1."""
    air_exchange: Array
    """Half of the leaks and what effects add, from the air below, m s-1."""
    leaf_area_index: Array
    canopy_conductance: Array
    """For vapour, m s-1."""
    sun_canopy: Array
    sun_floor: Array
    sun_cover: Array
    sun_screen: Array
    lamp_long_wave: Array
    heat: Array
    """Into the air: lamps, construction, effects, disturbances."""
    vapour: Array
    """Into the air, by effects and disturbances."""
    co2: Array
    """Into the air: dosing less net uptake, effects, disturbances."""
    rail_heat: Array
    """From the boiler to the pipe rail."""
    grow_heat: Array


class Ledger(NamedTuple):
    """What crossed the boundary during a step (J m-2, kg m-2), or a rate times seconds."""

    to_sky: Array
    to_outside: Array
    """Convection from the cover."""
    air_heat_out: Array
    """Sensible heat carried out with the air."""
    to_deep_soil: Array
    vapour_out: Array
    condensation: Array
    transpiration: Array
    floor_evaporation: Array
    co2_out: Array
    rail_loss: Array
    """From the pipe rail to the greenhouse (inside the boundary, for reports)."""
    grow_loss: Array


def capacities(p: GreenhouseParameters, leaf_area_index: Array) -> tuple[Array, ...]:
    """Return the heat capacities of air, top, canopy, cover, screen and floor, J m-2 K-1."""
    return (
        p.air_height * AIR_HEAT + p.equipment_capacity,
        p.top_height * AIR_HEAT,
        p.canopy_capacity * leaf_area_index + p.stem_capacity,
        p.cover_capacity * p.cover_area,
        p.screen_capacity,
        p.floor_capacity,
    )


def initial(xp: Any, air_temperature: Array, humidity: Array, co2: Array, outdoor_temperature: Array) -> Climate:
    """Return a state at rest: degC, %, ppm, degC."""
    vapour = vapour_concentration(xp, air_temperature, humidity)
    content = co2_concentration(air_temperature, co2)
    cover = 0.5 * (air_temperature + outdoor_temperature)
    one = air_temperature
    return Climate(
        air=one, top=one - 1.0, canopy=one - 0.5, cover=cover, screen=one - 0.5, floor=one - 0.5, vapour=vapour,
        top_vapour=vapour, co2=content, top_co2=content, soil_1=one - 1.0, soil_2=one - 2.0, soil_3=one - 4.0,
        rail=one + 1.0, grow=one + 1.0,
    )  # fmt: skip
