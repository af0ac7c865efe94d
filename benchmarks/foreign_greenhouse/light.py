"""Where short-wave radiation ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.foreign_greenhouse.plant import ForeignGreenhouse, Values
from igrow.core.greenhouse.weather_table import WeatherRow

SOLAR_CONSTANT = 1370.0
"""W m-2."""


def distribute(p: ForeignGreenhouse, s: Values, weather: WeatherRow, elevation: float, loss: Any) -> Values:
    """Return what canopy, floor, air and cover take up and what passes the cover, W m-2, and PAR, umol m-2 s-1.

    Args:
        p: parameters.
        s: states.
        weather: outside.
        elevation: of the sun, degrees.
        loss: fraction of the light that something hidden takes, 0 to 1.
    """
    clearness = weather.global_radiation / (SOLAR_CONSTANT * max(np.sin(np.radians(max(elevation, 0.0))), 0.02))
    diffuse = np.clip(1.15 - 1.25 * np.clip(clearness, 0.0, 1.0), 0.2, 1.0)
    direct = 1.08 * (1.0 - np.exp(-max(elevation, 0.0) / 13.0))
    passed = p.cover_transmission * (diffuse + (1.0 - diffuse) * direct)
    screens = (1.0 - (1.0 - p.screen_transmission) * s["energy_screen"]) * (1.0 - 0.98 * s["blackout_screen"])
    inside = weather.global_radiation * passed * screens * (1.0 - np.clip(loss, 0.0, 0.95))
    lamps = p.lamp_capacity * s["lamp"]
    shining = (0.92 - p.lamp_convection) * lamps
    held = 1.0 - np.exp(-0.72 * s["area"])
    par = 2.1 * inside + p.lamp_photons * lamps
    return {
        "inside": inside,
        "par": par,
        "absorbed": 0.9 * held * par,
        "canopy": held * (0.82 * inside + 0.7 * shining),
        "floor": (1.0 - held) * (0.55 * inside + 0.4 * shining),
        "air": 0.07 * inside + p.lamp_convection * lamps + 0.15 * held * shining,
        "cover": 0.05 * weather.global_radiation + 0.08 * lamps,
    }
