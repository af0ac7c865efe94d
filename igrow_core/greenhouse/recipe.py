"""A grower's plain schedule of setpoints, for want of a better plan."""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.greenhouse.climate_computer import ClimateComputer
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.sun import solar_hour
from igrow.core.telemetry import Telemetry

COMPUTER = {
    "humidity_setpoint": ClimateComputer().humidity_start,
    "ventilation_setpoint": 24.0,
    "minimum_pipe_setpoint": 0.0,
    "energy_screen_setpoint": 100.0,
}
"""Setpoints that not every PLC takes, where a table needs them."""


def recipe(time: np.datetime64, longitude: float = 4.53) -> dict[str, float]:
    """Return the four setpoints of a tomato grower in winter and spring at a time (UTC).

    Local solar time counts: 18.5 degC from 1 to 7 h, 20.5 degC to 17 h, 19 degC to 20 h, then a night of 17 degC;
    lamps, which the PLC puts off in strong light, and 800 ppm from 1 to 17 h, 400 ppm else; irrigation from 3 to 16 h.
    """
    hour = float(solar_hour(time, 52.0, longitude))
    if 7.0 <= hour < 17.0:
        temperature = 20.5
    elif 17.0 <= hour < 20.0:
        temperature = 19.0
    elif 1.0 <= hour < 7.0:
        temperature = 18.5
    else:
        temperature = 17.0
    return {
        "heating_setpoint": temperature,
        "co2_setpoint": 800.0 if 1.0 <= hour < 17.0 else 400.0,
        "lamp_on": 1.0 if 1.0 <= hour < 17.0 else 0.0,
        "irrigation_on": 1.0 if 3.0 <= hour < 16.0 else 0.0,
    }


def recipe_by_hour(start: np.datetime64, hours: int, longitude: float = 4.53) -> Floats:
    """Return the recipe at each hour from `start` (UTC) on, in the order of `SETPOINTS`, (hours, S)."""
    times = start + np.arange(hours) * np.timedelta64(3600, "s")
    rows = [COMPUTER | recipe(time, longitude) for time in times]
    return np.array([[row[name] for name in SETPOINTS] for row in rows])


def recipe_course(start: np.datetime64, end: np.datetime64) -> Telemetry:
    """Return the recipe hour by hour, both ends included (UTC)."""
    hours = np.arange(start, end + np.timedelta64(1, "h"), np.timedelta64(1, "h"))
    rows = recipe_by_hour(start, len(hours))
    return Telemetry(hours, {name: rows[:, column] for column, name in enumerate(USUAL_SETPOINTS)})


def varied_recipe(start: np.datetime64, end: np.datetime64, random: np.random.Generator) -> Telemetry:
    """Return the recipe hour by hour with each day's levels shifted, so that the data hold what planning may try."""
    plain = recipe_course(start, end)
    hours, rows = plain.time, np.stack([plain[name] for name in USUAL_SETPOINTS], axis=1)
    day = ((hours - start) // np.timedelta64(1, "D")).astype(int)
    shift = random.normal(0.0, 1.5, day.max() + 1)[day]
    carbon = random.uniform(0.6, 1.25, day.max() + 1)[day]
    lamps = random.random(day.max() + 1)[day] < 0.75
    rows[:, 0] = np.clip(rows[:, 0] + shift, 12.0, 26.0)
    rows[:, 1] = np.clip(rows[:, 1] * carbon, 400.0, 1000.0)
    rows[:, 2] *= lamps
    return Telemetry(hours, {name: rows[:, column] for column, name in enumerate(USUAL_SETPOINTS)})
