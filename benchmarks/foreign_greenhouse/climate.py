"""Heat, vapour and CO2: every state follows the others implicitly, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.foreign_greenhouse.crop import Exchange
from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, Values
from igrow.core.air import LATENT_HEAT, STEFAN_BOLTZMANN, VOLUMETRIC_HEAT, saturation_concentration
from igrow.core.greenhouse.weather_table import WeatherRow

TOP_HEIGHT = 0.9
"""Of the air above the screens, m."""


@dataclass(frozen=True)
class Air:
    """Where air goes, m3 m-2 s-1."""

    below: Any
    """From outside to below the screens, and back."""
    above: Any
    """From outside to above the screens, and back."""
    through: Any
    """Past the screens."""
    conducted: Any
    """Heat through the screens' cloth, W m-2 K-1."""


def vented(p: ForeignGreenhouse, s: Values, weather: WeatherRow) -> Any:
    """Return the air through the vents, m3 m-2 s-1.

    Wind after De Jong (1990), lee and windward side; buoyancy by the opening to the power 1.5; both add as squares
    (Boulard and Baille 1995).
    """
    lee, windward = 42.0 * s["vent_lee"], 42.0 * s["vent_wind"]
    shares = 2.29e-2 * (1.0 - np.exp(-lee / 21.1)) + 1.2e-3 * windward * np.exp(windward / 211.0)
    warmer = np.maximum(s["top"] - weather.outdoor_temperature, 0.0)
    opened = np.sin(np.radians(lee)) ** 1.5 + np.sin(np.radians(windward)) ** 1.5
    by_warmth = 0.2 * np.sqrt(9.81 * warmer / 288.0) * opened
    return p.vent_area * np.sqrt((shares * weather.wind_speed) ** 2 + by_warmth**2)


def air(p: ForeignGreenhouse, s: Values, weather: WeatherRow, vents: Any, hidden: Any) -> Air:
    """Return where air goes; a third of what leaks comes in below the screens, with what a hidden effect adds."""
    leakage = p.leakage * np.maximum(weather.wind_speed, 0.3)
    low = 0.35 * leakage + hidden
    energy, blackout = s["energy_screen"], s["blackout_screen"]
    slow = np.abs(s["air"] - s["top"]) ** 0.66
    through = 1.0 / (
        20.0
        + energy / ((1.0 - energy) * 0.06 + energy * p.screen_permeability * slow + 1e-5)
        + blackout / ((1.0 - blackout) * 0.06 + blackout * 3.0 * p.screen_permeability * slow + 1e-5)
    )
    cloth = 1.0 / (energy / p.energy_screen_conductance + blackout / p.blackout_screen_conductance + 1e-6)
    return Air(
        np.maximum(low, 0.0),
        0.65 * leakage + np.maximum(vents + np.minimum(low, 0.0), 0.0),
        through,
        np.where(energy + blackout > 0.02, np.minimum(cloth, 30.0), 0.0),
    )


def advance(
    p: ForeignGreenhouse,
    s: Values,
    weather: WeatherRow,
    light: Values,
    crop: Exchange,
    moved: Air,
    added: tuple[Any, Any, Any],
    seconds: float,
) -> None:
    """Carry temperatures, vapour and CO2 over a step.

    Args:
        p: parameters.
        s: states, carried on.
        weather: outside.
        light: of `distribute`.
        crop: of `exchange`.
        moved: of `air`.
        added: heat W m-2, vapour and CO2 kg m-2 s-1 that nobody knows of.
        seconds: of the step.
    """
    heat, vapour, co2 = added
    open_above = (1.0 - 0.85 * s["energy_screen"]) * (1.0 - 0.9 * s["blackout_screen"])
    rail = p.rail_exchange * np.maximum(s["rail"] - s["air"], 0.0) ** 1.25
    grow = p.grow_exchange * np.maximum(s["grow"] - s["air"], 0.0) ** 1.25
    to_floor = 1.7 * np.abs(s["floor"] - s["air"]) ** 0.33 + 0.4
    to_leaf = 2.0 * s["area"] * VOLUMETRIC_HEAT / p.leaf_resistance
    leaf_to_cover = 0.8 * _radiated(283.0) * (1.0 - np.exp(-0.9 * s["area"])) * open_above
    leaf_to_floor = 0.5 * _radiated(290.0)

    saturated = saturation_concentration(np, s["leaf"])
    steeper = 17.27 * 237.3 / (s["leaf"] + 237.3) ** 2 * saturated
    evaporation = LATENT_HEAT * crop.conductance
    s["leaf"] = _after(
        seconds, 4000.0 + 1300.0 * s["area"], s["leaf"],
        light["canopy"] + 0.25 * rail + 0.5 * grow
        - evaporation * (saturated - steeper * s["leaf"] - s["vapour"]),
        (to_leaf, s["air"]), (leaf_to_cover, s["cover"]), (leaf_to_floor, s["floor"]), (evaporation * steeper, 0.0),
    )  # fmt: skip
    s["floor"] = _after(
        seconds, 45_000.0, s["floor"], light["floor"] + 0.15 * rail,
        (to_floor, s["air"]), (leaf_to_floor, s["leaf"]), (1.1 / 0.12, s["soil"]),
    )  # fmt: skip
    s["soil"] = _after(seconds, 3.2e5, s["soil"], 0.0, (1.1 / 0.12, s["floor"]), (1.1 / 0.45, s["deep"]))
    s["deep"] = _after(seconds, 1.1e6, s["deep"], 0.0, (1.1 / 0.45, s["soil"]), (0.8, 11.5))
    upward = VOLUMETRIC_HEAT * moved.through + moved.conducted
    s["air"] = _after(
        seconds, VOLUMETRIC_HEAT * p.air_height + p.equipment_capacity, s["air"],
        light["air"] + heat + 0.6 * rail + 0.5 * grow, (to_leaf, s["leaf"]), (to_floor, s["floor"]),
        (upward, s["top"]), (VOLUMETRIC_HEAT * moved.below, weather.outdoor_temperature),
    )  # fmt: skip
    inside = 1.9 * np.abs(s["top"] - s["cover"]) ** 0.33 * p.cover_area + 0.3
    s["top"] = _after(
        seconds, VOLUMETRIC_HEAT * TOP_HEIGHT, s["top"], 0.0, (upward, s["air"]), (inside, s["cover"]),
        (VOLUMETRIC_HEAT * moved.above, weather.outdoor_temperature),
    )  # fmt: skip
    wind = weather.wind_speed
    outside = np.where(wind < 4.0, 2.8 + 1.2 * wind, 2.5 * np.maximum(wind, 0.0) ** 0.8) * p.cover_area
    dew = inside / (VOLUMETRIC_HEAT * 0.89**0.67) * (s["vapour_top"] - saturation_concentration(np, s["cover"]))
    dew = np.maximum(dew, 0.0)
    s["cover"] = _after(
        seconds, 8_600.0 * p.cover_area, s["cover"], light["cover"] + LATENT_HEAT * dew, (inside, s["top"]),
        (leaf_to_cover, s["leaf"]), (0.55 * _radiated(285.0) * (1.0 - open_above), 0.4 * s["air"] + 0.6 * s["top"]),
        (outside, weather.outdoor_temperature),
        (p.cover_emission * p.cover_area * _radiated(275.0), weather.sky_temperature),
    )  # fmt: skip
    damp = p.floor_wetness * to_floor / VOLUMETRIC_HEAT
    damp = damp * np.maximum(saturation_concentration(np, s["floor"]) - s["vapour"], 0.0)
    s["vapour"] = np.maximum(
        _after(
            seconds, p.air_height, s["vapour"], vapour + damp, (crop.conductance, saturated),
            (moved.through, s["vapour_top"]), (moved.below, weather.vapour),
        ), 1e-4,
    )  # fmt: skip
    s["vapour_top"] = np.maximum(
        _after(
            seconds, TOP_HEIGHT, s["vapour_top"], -dew, (moved.through, s["vapour"]), (moved.above, weather.vapour)
        ), 1e-4,
    )  # fmt: skip
    gain = co2 + crop.respired - crop.taken + p.co2_capacity / 3600.0 * s["dosing"]
    s["co2"] = np.maximum(
        _after(
            seconds, p.air_height, s["co2"], gain, (moved.through, s["co2_top"]), (moved.below, weather.co2)
        ), 1e-5,
    )  # fmt: skip
    s["co2_top"] = _after(
        seconds, TOP_HEIGHT, s["co2_top"], 0.0, (moved.through, s["co2"]), (moved.above, weather.co2)
    )  # fmt: skip
    s["box"] = s["box"] + (1.0 - np.exp(-seconds / 100.0)) * (s["air"] - s["box"])


def _after(seconds: float, capacity: Any, value: Any, gain: Any, *others: tuple[Any, Any]) -> Any:
    """Return a state after a step: `others` are conductances and what they lead to (implicit Euler)."""
    held = capacity / seconds
    return (held * value + gain + sum(g * other for g, other in others)) / (held + sum(g for g, _ in others))


def _radiated(kelvin: float) -> float:
    """Return the long-wave conductance between black bodies about a temperature, W m-2 K-1."""
    return 4.0 * STEFAN_BOLTZMANN * kelvin**3
