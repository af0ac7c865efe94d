"""The climate stage gives the same day whatever its step: a numerical step too coarse would look like physics."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.parameters import PARAMETERS

MINUTES = 1440
# A crop that answers strongly to the air couples heat and vapour most tightly.
VALUES = {name: parameter.value for name, parameter in PARAMETERS.items()} | {"transpiration_moist_air": 110.0}

PULSES = np.where((np.arange(MINUTES) % 50 < 3) & (np.arange(MINUTES) // 60 % 24 >= 6), 6.0, 0.0)
"""Irrigation of each minute, L m-2 h-1: three minutes of fifty."""
WET = {"irrigation_evaporation": {"share": 0.02, "time_constant": 20.0}}
"""So little that the air stays below saturation, beyond which condensation has kinks."""


def inputs_over(first: int, minutes: int) -> dict[str, NDArray[np.float64]]:
    """Mean inputs over some minutes of a day with lamps, screens and a little sun."""
    hour = (first + np.arange(minutes)).mean() / 60.0
    sun = max(0.0, float(np.sin((hour - 6.0) / 12.0 * np.pi)))
    lamps = 1.0 if 2.0 < hour < 17.0 else 0.0
    values = {
        "outdoor_temperature": 6.0 + 5.0 * sun,
        "outdoor_humidity": 90.0 - 20.0 * sun,
        "outdoor_co2": 415.0,
        "global_radiation": 450.0 * sun,
        "wind_speed": 4.0,
        "sky_temperature": -4.0,
        "rail_pipe_temperature": 45.0 - 20.0 * sun,
        "grow_pipe_temperature": 35.0,
        "vent_lee": 4.0 + 15.0 * sun,
        "vent_wind": 0.0,
        "energy_screen": 0.0 if sun else 97.0,
        "blackout_screen": 0.0 if sun else 95.0 * lamps,
        "lamp_power": 81.0 * lamps,
        "co2_dosing": 0.006 * lamps,
        "irrigation": float(np.mean(PULSES[first : first + minutes])),
        "leaf_area_index": 3.2,
        "mean_height": 5.0,
    }
    return {name: np.array([value]) for name, value in values.items()}


def half_hours(minutes: int, effects: climate.ActiveEffects | None = None) -> NDArray[np.float64]:
    """Air temperature, humidity and CO2 at each half hour of the day, stepped by so many minutes, (48, 3)."""
    active = effects or {}
    start = {"air_temperature": 18.0, "air_humidity": 85.0, "air_co2": 600.0}
    begin = {name: np.array([value]) for name, value in start.items()}
    state = climate.initial_state(np, begin, inputs_over(0, minutes), VALUES, active, 1.24)
    rows = []
    for first in range(0, MINUTES, minutes):
        now = inputs_over(first, minutes)
        state = climate.advance(np, state, now, VALUES, active, seconds=60.0 * minutes, lamp_efficacy=1.24)
        if (first + minutes) % 30 == 0:
            drivers = climate.derive(np, state, now, VALUES, 1.24)
            rows.append([float(drivers[name][0]) for name in start])
    return np.array(rows)


@pytest.mark.parametrize(
    ("minutes", "limits"), [(5, (0.03, 0.08, 1.0)), (15, (0.06, 0.25, 2.0)), (30, (0.12, 0.6, 4.0))]
)
def test_a_day_in_longer_steps_is_the_day_in_steps_of_a_minute(
    minutes: int, limits: tuple[float, float, float]
) -> None:
    error = np.abs(half_hours(minutes) - half_hours(1)).mean(axis=0)
    print(f"{minutes} min: {error[0]:.3f} K, {error[1]:.3f} %, {error[2]:.2f} ppm")
    assert (error < limits).all(), error


def test_pulses_within_a_step_are_felt_in_it() -> None:
    """What an effect with a memory does to humidity is the same in steps of fifteen minutes and of one."""
    felt = (half_hours(minutes, WET)[:, 1] - half_hours(minutes)[:, 1] for minutes in (1, 15))
    # Over an hour, since within a quarter of it nobody can tell when in it the water came.
    short, long = (course.reshape(-1, 2).mean(axis=1) for course in felt)
    error, size = np.abs(long - short).mean(), np.abs(short).mean()
    print(f"{error:.2f} of {size:.2f} %")
    assert error < 0.15 * size
