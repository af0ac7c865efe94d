"""Short-wave radiation: how much passes the cover and the screens, and which body it warms.

The cover lets a fixed fraction of the hemispherical radiation through (what depends on angle or age is an effect
of the catalogue). In the canopy PAR and near-infrared fall off exponentially (Vanthoor 2011, appendix section 4);
what the floor throws back passes the canopy once more.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from igrow.core.arrays import Array
from igrow.core.greenhouse.parameters import GreenhouseParameters

JOULE_PER_MICROMOLE = 1.0 / 4.6
"""Energy of PAR photons of daylight, J umol-1."""


class Light(NamedTuple):
    """Short-wave radiation, W m-2 of floor unless said."""

    par: Array
    """Above the crop, umol m-2 s-1."""
    par_absorbed: Array
    """By the canopy, umol m-2 s-1."""
    inside: Array
    """Global radiation below cover and screens, without lamps."""
    canopy: Array
    floor: Array
    air: Array
    """By way of the construction."""
    cover: Array
    screen: Array
    lamp_long_wave: Array
    """Long-wave radiation of the lamps, to be shared among the bodies."""
    lamp_air: Array
    lamp_out: Array
    """Lamp light that leaves through the cover: it keeps the bookkeeping closed."""
    sun_absorbed: Array
    """All solar radiation that stays inside."""


def canopy_absorption(xp: Any, extinction: Array, reflection: Array, floor_reflection: Array, area: Array) -> Any:
    """Return (fraction absorbed by the canopy, by the floor, sent back up) of light that falls on the crop.

    `area` is the leaf area index. The three add to one.
    """
    through = xp.exp(-extinction * area)
    caught = (1.0 - reflection) * (1.0 - through)
    thrown = through * floor_reflection
    canopy = caught + thrown * caught
    floor = through * (1.0 - floor_reflection)
    return canopy, floor, 1.0 - canopy - floor


def distribute(
    xp: Any,
    parameters: GreenhouseParameters,
    global_radiation: Array,
    lamp_power: Array,
    leaf_area_index: Array,
    energy_closure: Array,
    blackout_closure: Array,
    light_loss: Array,
) -> Light:
    """Share out the radiation of sun and lamps.

    Args:
        xp: the namespace.
        parameters: of the greenhouse.
        global_radiation: outdoors on a horizontal plane, W m-2.
        lamp_power: electric, W m-2.
        leaf_area_index: m2 m-2.
        energy_closure: 0 to 1.
        blackout_closure: 0 to 1.
        light_loss: fraction of the transmitted light that is lost besides (effects), 0 to 1.
    """
    p = parameters
    radiation = xp.maximum(global_radiation, 0.0)
    below_cover = radiation * p.cover_transmission * (1.0 - light_loss)
    passing = (1.0 - energy_closure * (1.0 - p.energy_screen_transmission)) * (
        1.0 - blackout_closure * (1.0 - p.blackout_screen_transmission)
    )
    screen = p.screen_absorption * below_cover * (1.0 - passing)
    inside = below_cover * passing
    air = p.construction_absorption * inside
    on_crop = inside - air
    # Half of the global radiation is PAR, half near-infrared; the construction takes from both alike.
    lamp_photons = p.lamp_photons * lamp_power
    lamp_par = lamp_photons * JOULE_PER_MICROMOLE
    lamp_infrared = p.lamp_infrared * lamp_power
    lamp_air = p.lamp_convection * lamp_power
    lamp_long_wave = lamp_power - lamp_par - lamp_infrared - lamp_air
    par_canopy, par_floor, _ = canopy_absorption(
        xp, p.extinction_par, p.reflection_par, p.floor_reflection, leaf_area_index
    )
    infrared_canopy, infrared_floor, _ = canopy_absorption(
        xp, p.extinction_infrared, p.reflection_infrared, p.floor_reflection, leaf_area_index
    )
    sun_par = 0.5 * on_crop
    par = p.photons_per_joule * on_crop + lamp_photons
    canopy_sun = sun_par * (par_canopy + infrared_canopy)
    floor_sun = sun_par * (par_floor + infrared_floor)
    canopy_lamp = lamp_par * par_canopy + lamp_infrared * infrared_canopy
    floor_lamp = lamp_par * par_floor + lamp_infrared * infrared_floor
    cover = p.cover_absorption * radiation
    return Light(
        par=par,
        par_absorbed=par * par_canopy,
        inside=inside,
        canopy=canopy_sun + canopy_lamp,
        floor=floor_sun + floor_lamp,
        air=air,
        cover=cover,
        screen=screen,
        lamp_long_wave=lamp_long_wave,
        lamp_air=lamp_air,
        lamp_out=lamp_par + lamp_infrared - canopy_lamp - floor_lamp,
        sun_absorbed=canopy_sun + floor_sun + air + cover + screen,
    )
