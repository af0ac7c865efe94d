"""Air exchange: through the vents by wind and by buoyancy, through leaks, and past the screens.

All flows are m3 of air per m2 of floor per second. References: T. de Jong (1990), Natural ventilation of large
multi-span greenhouses, PhD thesis, Wageningen; De Zwart (1996), section 2.4; Vanthoor (2011), electronic
appendix, section 8; T. Boulard and A. Baille (1993), Agricultural and Forest Meteorology 65, 145-157.
"""

from __future__ import annotations

from typing import Any

from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters

GRAVITY = 9.81
"""m s-2."""


def through_vents(
    xp: Any,
    parameters: GreenhouseParameters,
    vent_lee: Array,
    vent_wind: Array,
    wind_speed: Array,
    temperature_difference: Array,
) -> Array:
    """Return the flow through the roof vents, m s-1.

    Args:
        xp: the namespace.
        parameters: of the greenhouse.
        vent_lee: opening of the lee-side vents, 0 to 1.
        vent_wind: opening of the wind-side vents, 0 to 1.
        wind_speed: m s-1.
        temperature_difference: air below the vents minus outdoor air, K.

    Wind: De Jong (1990), quoted by De Zwart (1996, eq. 2.61 ff.): with the opening angle a in degrees, a lee-side
    vent moves 0.0229 (1 - exp(-a / 21.1)) and a wind-side vent 0.0012 a exp(a / 211) m3 per m2 of vent for
    each m s-1. Buoyancy: (Cd / 3) sqrt(g h dT / T) per vent area with its vertical opening (Boulard and Baille
    1993). Wind and buoyancy add as squares.
    """
    lee = 0.0229 * (1.0 - xp.exp(vent_lee * (parameters.vent_angle / -21.1)))
    wind_angle = vent_wind * parameters.vent_angle
    wind = 0.0012 * wind_angle * xp.exp(wind_angle / 211.0)
    by_wind = parameters.vent_area * (lee + wind) * wind_speed
    opening = 0.72 * (vent_lee + vent_wind)
    warmer = xp.maximum(temperature_difference, 0.01)
    by_buoyancy = (
        parameters.vent_area
        * parameters.vent_discharge
        * (1.0 / 3.0)
        * opening
        * xp.sqrt((GRAVITY / 288.0) * parameters.vent_height * opening * warmer + 1e-9)
    )
    return xp.sqrt(by_wind * by_wind + by_buoyancy * by_buoyancy)


def leakage(xp: Any, parameters: GreenhouseParameters, wind_speed: Array) -> Array:
    """Return the flow through leaks, m s-1: proportional to the wind, at least that at 0.25 m s-1 (Vanthoor)."""
    return parameters.leakage * xp.maximum(wind_speed, 0.25)


def past_screen(xp: Any, closure: Array, permeability: Array, gap: Array, temperature_difference: Array) -> Array:
    """Return the flow between the air below and above one screen, m s-1.

    Args:
        xp: the namespace.
        closure: 0 to 1.
        permeability: of the closed cloth, m s-1 K-0.66.
        gap: fraction that stays open in a closed screen.
        temperature_difference: air below minus above, K.

    Vanthoor (2011, appendix eq. 40; Balemans 1989): through the cloth K |dT|^0.66, through the open part
    sqrt(g (1 - U) dT / (2 T)) per open area. A floor of 2 cm s-1 in the open part keeps both airs one where no
    screen is drawn.
    """
    size = xp.sqrt(temperature_difference * temperature_difference + 0.04)
    cold_above = xp.maximum(temperature_difference, 0.0) + 0.05
    open_part = 1.0 - closure * (1.0 - gap)
    through_cloth = closure * permeability * xp.exp(0.66 * xp.log(size))
    through_gap = open_part * (xp.sqrt((0.5 * GRAVITY / 288.0) * open_part * cold_above) + 0.02 * open_part)
    return through_cloth + through_gap


def past_screens(
    xp: Any,
    parameters: GreenhouseParameters,
    energy_closure: Array,
    blackout_closure: Array,
    temperature_difference: Array,
) -> Array:
    """Return the flow past both screens, m s-1: two resistances one after the other (inputs as `past_screen`)."""
    energy = past_screen(
        xp, energy_closure, parameters.energy_screen_permeability, parameters.screen_gap, temperature_difference
    )
    blackout = past_screen(
        xp, blackout_closure, parameters.blackout_screen_permeability, parameters.screen_gap, temperature_difference
    )
    return energy * blackout / (energy + blackout)
