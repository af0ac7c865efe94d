"""The numbers of one greenhouse, its crop and its equipment, each with unit and source.

The defaults describe a glass compartment of 96 m2 with cherry tomato, high-pressure sodium lamps of 81 W m-2, two
screens, pipe rail (2.1 W m-2 K-1) and grow pipe (0.62 W m-2 K-1), as in the Autonomous Greenhouse Challenge
of 2019 (Hemming et al. 2020, Sensors 20, 6430). [V] is Vanthoor (2011) with its electronic appendix, [K] Katzin et
al. (2020), [Z] De Zwart (1996), [S] Stanghellini (1987), [D] De Koning (1994); [C] was chosen so that a season
with the weather of that challenge is plausible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError

Number = Any
"""A float, or an array of shape (N,) where a batch of greenhouses differs."""


@dataclass(frozen=True)
class GreenhouseParameters:
    """All parameters of the plant; every field is a float or, in a batch, an array of shape (N,)."""

    # Place and geometry
    latitude: float = 52.03
    """Degrees north (one for a whole batch)."""
    longitude: float = 4.53
    """Degrees east (one for a whole batch)."""
    air_height: Number = 5.0
    """Height of the air below the screens, m [C]."""
    top_height: Number = 0.8
    """Height of the air above the screens, m [C]."""
    cover_area: Number = 1.15
    """Area of cover and outer walls per floor area, 1 [C]: a compartment between others, with glass roof."""

    # Light
    cover_transmission: Number = 0.62
    """Fraction of the outdoor short-wave radiation that passes cover and construction, 1 [C]."""
    cover_absorption: Number = 0.04
    """Fraction that the cover absorbs, 1 [V]."""
    construction_absorption: Number = 0.06
    """Fraction of the transmitted radiation that ends as heat in the air by way of construction, 1 [V] 0.1."""
    energy_screen_transmission: Number = 0.75
    """Short-wave transmission of the closed energy screen, 1 (challenge economics: 1 - 0.25)."""
    blackout_screen_transmission: Number = 0.02
    """Short-wave transmission of the closed blackout screen, 1 (challenge economics: 1 - 0.98)."""
    screen_absorption: Number = 0.12
    """Fraction of the radiation kept back by a screen that warms it, 1 [C]; the rest goes out."""
    photons_per_joule: Number = 2.1
    """PAR photons in global radiation, umol J-1 (0.5 of it is PAR at 4.2 umol J-1)."""
    extinction_par: Number = 0.7
    """Extinction coefficient of PAR in the canopy, 1 [V]."""
    extinction_infrared: Number = 0.27
    """Extinction coefficient of near-infrared, 1 [V]."""
    reflection_par: Number = 0.07
    """Reflection of PAR by the canopy, 1 [V]."""
    reflection_infrared: Number = 0.35
    """Reflection of near-infrared by the canopy, 1 [V]."""
    floor_reflection: Number = 0.5
    """Reflection of the white floor, 1 [V] 0.65 for PAR, 0.45 for near-infrared."""

    # Lamps
    lamp_capacity: Number = 81.0
    """Electric power of the lamps, W m-2 (challenge)."""
    lamp_photons: Number = 1.24
    """PAR photons of the lamps, umol per joule of electricity (challenge: 100 umol m-2 s-1 from 81 W m-2)."""
    lamp_infrared: Number = 0.22
    """Fraction of the electric power emitted as near-infrared, 1 [K] for sodium lamps."""
    lamp_convection: Number = 0.20
    """Fraction of the electric power that goes to the air at once, 1 [K]; what is left is long-wave."""

    # Long-wave radiation
    cover_emission: Number = 0.85
    """Long-wave emission of glass, 1 [V]."""
    canopy_emission: Number = 1.0
    """Long-wave emission of the canopy, 1 [V]."""
    screen_emission: Number = 0.67
    """Long-wave emission of a screen, 1 [V]."""
    screen_long_wave_transmission: Number = 0.15
    """Long-wave transmission of the closed energy screen, 1 [V]."""
    extinction_long_wave: Number = 0.94
    """Extinction of long-wave radiation in the canopy, 1 [V]."""

    # Convection
    leaf_convection: Number = 5.0
    """Convection between one leaf side and air, W m-2 K-1 [V]."""
    cover_inside_convection: Number = 1.86
    """Convection between top air and cover, W m-2 K-1.33 [V], per cover area."""
    cover_outside_convection: Number = 2.8
    """Convection between cover and outdoor air without wind, W m-2 K-1 [V], per cover area."""
    cover_wind_convection: Number = 1.2
    """The same for each m s-1 of wind, W m-2 K-1 (m s-1)-1 [V]."""

    # Heat capacities and soil
    canopy_capacity: Number = 1200.0
    """Heat capacity of leaves, J K-1 per m2 of leaf [V]."""
    stem_capacity: Number = 6000.0
    """Heat capacity of stems, fruits and substrate in the canopy, J m-2 K-1 [C]."""
    cover_capacity: Number = 8400.0
    """Heat capacity of the glass, J K-1 per m2 of cover (4 mm) [V]."""
    screen_capacity: Number = 600.0
    """Heat capacity of the screens, J m-2 K-1 [V]."""
    equipment_capacity: Number = 15_000.0
    """Heat capacity of construction, gutters and equipment that follow the air, J m-2 K-1 [C]."""
    floor_capacity: Number = 26_000.0
    """Heat capacity of the floor's upper centimetres, J m-2 K-1 [V]."""
    soil_heat_capacity: Number = 1.73e6
    """Volumetric heat capacity of the soil, J m-3 K-1 [V]."""
    soil_conductivity: Number = 0.85
    """Heat conductivity of the soil, W m-1 K-1 [V]."""
    deep_soil_temperature: Number = 13.0
    """Temperature of the soil below 1.5 m, degC [V]."""

    # Ventilation
    leakage: Number = 1.0e-4
    """Leakage for each m s-1 of wind, m3 m-2 s-1 [V] 1e-4."""
    vent_area: Number = 0.12
    """Area of the vents of one side per floor area, 1 [C]."""
    vent_angle: Number = 44.0
    """Angle of a fully open vent, degrees [Z]."""
    vent_height: Number = 0.9
    """Height of a vent, m [C]."""
    vent_discharge: Number = 0.65
    """Discharge coefficient of an opening for stack ventilation, 1 [V] 0.75, [Z] 0.6."""
    energy_screen_permeability: Number = 5.0e-5
    """Exchange through the closed energy screen, m s-1 K-0.66 [V]."""
    blackout_screen_permeability: Number = 1.5e-4
    """Exchange through the closed blackout screen, m s-1 K-0.66 [C]: it lets moisture through."""
    screen_gap: Number = 0.01
    """Fraction that stays open in a closed screen, 1 [C]."""

    # Heating
    rail_exchange: Number = 2.1
    """Heat that the pipe rail gives for each kelvin above the air, W m-2 K-1 (challenge resources)."""
    grow_exchange: Number = 0.62
    """The same of the grow pipe, W m-2 K-1 (challenge resources)."""
    pipe_convection: Number = 0.55
    """Fraction of the pipe heat given by convection, 1 [Z]; the rest is long-wave."""
    rail_capacity: Number = 13_000.0
    """Heat capacity of the pipe rail with its water, J m-2 K-1 [C]."""
    grow_capacity: Number = 4_000.0
    """Heat capacity of the grow pipe with its water, J m-2 K-1 [C]."""
    boiler_capacity: Number = 200.0
    """Largest heat input to all pipes together, W m-2 [C]."""

    # Canopy gas exchange
    boundary_resistance: Number = 275.0
    """Resistance of the leaf boundary layer to vapour, s m-1 [V]."""
    minimum_stomatal_resistance: Number = 82.0
    """Stomatal resistance at full light, s m-1 [V]."""
    night_stomatal_resistance: Number = 1600.0
    """Upper limit of the stomatal resistance, s m-1 [C] after [S]."""
    floor_wetness: Number = 0.03
    """Fraction of a wet surface's evaporation that floor and substrate give off, 1 [C]."""
    electron_transport: Number = 90.0
    """Largest electron transport at 25 degC, umol s-1 per m2 of leaf [V] 210, which is for a young leaf [C]."""

    # Crop
    stem_density: Number = 3.9
    """Stems m-2."""
    fruits_per_truss: Number = 17.0
    """Fruits kept on a truss, 1 (cherry tomato)."""
    specific_leaf_area: Number = 26.6
    """m2 of leaf per kg of carbohydrate in leaves [V]."""
    leaf_area_maximum: Number = 3.0
    """Leaf area index to which the crop is deleafed, 1 [V]."""
    deleafing_interval: Number = 7.0
    """Days between two deleafings."""
    fruit_growth: Number = 0.22e-6
    """Potential growth of all fruits at 20 degC, kg m-2 s-1 [V] 0.328e-6 for round tomato; less in cherry [C]."""
    leaf_growth: Number = 0.095e-6
    """Potential growth of all leaves, kg m-2 s-1 [V]."""
    stem_growth: Number = 0.074e-6
    """Potential growth of stems and roots, kg m-2 s-1 [V]."""
    fruit_dry_matter: Number = 0.085
    """Dry matter content of ripe fruit, 1 (cherry tomato)."""
    generative_sum: Number = 1035.0
    """Temperature sum from first truss to full fruit load, degC d [V]."""

    # Carbon dioxide
    co2_capacity: Number = 0.015
    """Largest dosing, kg m-2 h-1 (challenge)."""

    # Water
    irrigation_rate: Number = 6.0
    """Irrigation during a pulse, L m-2 h-1 [C]."""
    slab_capacity: Number = 9.0
    """Water that the substrate holds, L m-2 [C]; more runs off as drain."""

    def varied(self, rng: np.random.Generator, relative: float = 0.08) -> GreenhouseParameters:
        """Return a greenhouse whose uncertain parameters are each off by a log-normal factor of that size.

        Fractions (transmission, emission, reflection) stay below 0.98.
        """
        changes: dict[str, Any] = {}
        for entry in fields(self):
            if entry.name in KNOWN:
                continue
            value = getattr(self, entry.name)
            changed = value * np.exp(rng.normal(0.0, relative, np.shape(value)))
            if np.max(value) < 1.0:
                changed = np.minimum(changed, 0.98)
            changes[entry.name] = changed if np.ndim(changed) else float(changed)
        return replace(self, **changes)


KNOWN = frozenset(
    {
        "latitude",
        "longitude",
        "photons_per_joule",
        "lamp_capacity",
        "canopy_emission",
        "deep_soil_temperature",
        "vent_angle",
        "vent_height",
        "stem_density",
        "fruits_per_truss",
        "leaf_area_maximum",
        "deleafing_interval",
        "co2_capacity",
        "irrigation_rate",
    }
)
"""What a grower knows for certain, so that `varied` leaves it as it is."""


def stack(parameters: Sequence[GreenhouseParameters]) -> GreenhouseParameters:
    """Return one set for a batch of N greenhouses; a field that is the same in all stays a float.

    Raises:
        IgrowError: where the greenhouses do not stand at one place.
    """
    first = parameters[0]
    if any((one.latitude, one.longitude) != (first.latitude, first.longitude) for one in parameters):
        raise IgrowError("a batch of greenhouses must stand at one latitude and longitude")
    changes: dict[str, Any] = {}
    for entry in fields(first):
        values = [getattr(one, entry.name) for one in parameters]
        if any(value != values[0] for value in values):
            changes[entry.name] = np.array(values, dtype=np.float64)
    return replace(first, **changes)
