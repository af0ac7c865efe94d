"""Everything about the plant that changes with time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from igrow.core.arrays import Array
from igrow.core.greenhouse.climate_computer import Control
from igrow.core.greenhouse.climate_state import Climate
from igrow.core.greenhouse.light import Light
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import Crop, Rates

ACCUMULATED = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen", "lamp_power", "co2_dosing", "irrigation")
"""Actuators that a log shows as the mean since the row before."""


@dataclass
class PlantState:
    """All that changes while the plant runs; floats or arrays (N,). It can be copied and pickled."""

    seconds: float
    """Time, since 1970 UTC."""
    climate: Climate
    crop: Crop
    control: Control
    slab: Array
    """Water in the substrate, L m-2."""
    transpiration: Array
    """Of the last tick, kg m-2 s-1, as is the next."""
    assimilation: Array
    """Gross uptake of CO2 without what is hidden: a hidden effect takes its share of this, and not of its own."""
    respiration: Array
    """Of the crop, kg CH2O m-2 s-1, as of the last slow step."""
    light: Light | None
    assimilated: Array
    """Carbohydrate fixed since the last slow step, kg m-2."""
    warmth: Array
    """Canopy temperature times seconds since the last slow step."""
    crop_seconds: float
    crop_rates: Rates
    deleafed_day: int
    scan: int
    """Number of the climate computer's last decision."""
    disturbance: list[Array]
    """Heat W m-2, vapour and CO2 kg m-2 s-1 into the air."""
    noise: dict[str, Array]
    sensor_errors: dict[str, Array]
    memory: list[Any]
    """Of the hidden effects."""
    trend: list[Array]
    """Change per second, in the last tick, of the states that the gas exchange depends on."""
    generator: np.random.Generator
    totals: dict[str, Array] = field(default_factory=dict)
    """Everything that crossed the boundary since the start: J m-2 and kg m-2."""
    log: dict[str, Array] = field(default_factory=dict)
    """Actuators times seconds since `mean_actuators` was last reset."""
    log_seconds: float = 0.0

    def actuators(self, parameters: GreenhouseParameters) -> tuple[Array, ...]:
        """Return what the actuators do now, in the order and the units of `ACCUMULATED`."""
        c = self.control
        return (
            100.0 * c.vent_lee,
            100.0 * c.vent_wind,
            100.0 * c.energy_screen,
            100.0 * c.blackout_screen,
            parameters.lamp_capacity * c.lamp,
            c.co2_dosing,
            c.irrigation,
        )


def add(totals: dict[str, Array], name: str, amount: Array) -> None:
    """Add an amount to a running total."""
    totals[name] = totals[name] + amount if name in totals else amount
