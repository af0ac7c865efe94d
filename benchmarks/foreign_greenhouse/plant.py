"""What a greenhouse is made of, and the state that it is in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

State = dict[str, float]
"""Every state of one greenhouse by its name; in a batch each is an array (N,)."""
Values = dict[str, Any]
"""Named values of a batch, each a float or an array (N,)."""


@dataclass(frozen=True)
class ForeignGreenhouse:
    """The parameters of one greenhouse; in a batch each is an array (N,)."""

    latitude: Any = 51.0
    """Degrees north (one for a whole batch)."""
    longitude: Any = 6.0
    """Degrees east (one for a whole batch)."""
    lamp_capacity: Any = 110.0
    """Electric power of the lamps, W m-2."""
    air_height: Any = 4.6
    """Height of the air below the screens, m."""
    cover_area: Any = 1.25
    """Area of cover and walls per floor area, 1."""
    cover_transmission: Any = 0.68
    """Fraction of diffuse light that passes the cover, 1; what of direct light does hangs on the sun's height."""
    screen_transmission: Any = 0.8
    """Fraction of light that passes the closed energy screen, 1."""
    energy_screen_conductance: Any = 2.6
    """Heat through the closed energy screen, W m-2 K-1."""
    blackout_screen_conductance: Any = 4.5
    """Heat through the closed blackout screen, W m-2 K-1."""
    screen_permeability: Any = 1.5e-4
    """Air through the closed energy screen, m s-1 K-0.66; three times as much passes the blackout screen."""
    vent_area: Any = 0.14
    """Area of the vents of one side per floor area, 1."""
    leakage: Any = 1.6e-4
    """Leakage for each m s-1 of wind, m3 m-2 s-1."""
    cover_emission: Any = 0.84
    """Long-wave emission of the cover, 1."""
    rail_exchange: Any = 0.95
    """Heat of the pipe rail, W m-2 K-1.25."""
    grow_exchange: Any = 0.3
    """Heat of the grow pipe, W m-2 K-1.25."""
    lamp_photons: Any = 1.7
    """PAR photons of the lamps, umol J-1."""
    lamp_convection: Any = 0.34
    """Fraction of the lamps' power that warms the air, 1."""
    equipment_capacity: Any = 22_000.0
    """Heat capacity of all that follows the air, J m-2 K-1."""
    leaf_area_maximum: Any = 2.9
    """Leaf area index to which the crop is picked every Tuesday, 1."""
    leaf_resistance: Any = 220.0
    """Resistance of the leaf boundary layer to heat, s m-1."""
    stomatal_resistance: Any = 82.0
    """Least stomatal resistance, s m-1 (Stanghellini 1987)."""
    assimilation: Any = 21.0
    """Largest gross photosynthesis, umol s-1 per m2 of leaf."""
    respiration: Any = 9.0e-8
    """Maintenance of the crop at 25 degC, kg CO2 m-2 s-1."""
    floor_wetness: Any = 0.015
    """Fraction of a wet surface's evaporation that the floor gives off, 1."""
    co2_capacity: Any = 0.012
    """Dosing, kg m-2 h-1."""

    def varied(self, rng: np.random.Generator, relative: float) -> ForeignGreenhouse:
        """Return a greenhouse whose uncertain parameters are each off by a log-normal factor of that size."""
        names = [one.name for one in fields(self) if one.name not in {"latitude", "longitude", "lamp_capacity"}]
        values = {name: getattr(self, name) * float(np.exp(rng.normal(0.0, relative))) for name in names}
        return replace(self, **values | {"cover_transmission": min(values["cover_transmission"], 0.85)})


def stacked(plants: Sequence[ForeignGreenhouse]) -> ForeignGreenhouse:
    """Return the parameters of a batch."""
    names = [one.name for one in fields(ForeignGreenhouse)]
    return ForeignGreenhouse(**{name: np.array([float(getattr(one, name)) for one in plants]) for name in names})


def begun(plant: ForeignGreenhouse, *, young: bool = False) -> State:
    """Return the state that a log begins with: a crop that stands, or one that was just planted."""
    return {
        # Temperatures, degC: `box` is what the sensors' housing has.
        "air": 18.0, "top": 14.0, "cover": 9.0, "leaf": 18.0, "floor": 17.0, "soil": 16.0, "deep": 14.0, "box": 18.0,
        "rail": 30.0, "grow": 25.0,
        # Contents of the air below and above the screens, kg m-3.
        "vapour": 0.0115, "vapour_top": 0.0097, "co2": 9.2e-4, "co2_top": 8.4e-4,
        # Leaf area index, and CO2 taken up that is yet to become a crop, kg m-2.
        "area": 0.4 if young else 0.93 * plant.leaf_area_maximum, "buffer": 3e-4 if young else 3e-3,
        # The computer's memory and positions, 0 to 1; seconds of a pulse that are left.
        "integral": 0.0, "vent_lee": 0.0, "vent_wind": 0.0, "energy_screen": 0.0, "blackout_screen": 0.0, "lamp": 0.0,
        "dosing": 0.0, "light_sum": 0.0, "pulse": 0.0,
        # Fluxes of the last step that hidden effects are driven by: air through the vents m s-1, kg m-2 s-1.
        "ventilation": 0.0, "transpiration": 0.0, "assimilation": 0.0,
    }  # fmt: skip
