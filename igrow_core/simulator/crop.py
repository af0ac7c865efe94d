"""The crop stages of the hybrid simulator: small networks, trained on the mechanistic tomato and on logs."""

from __future__ import annotations

from dataclasses import dataclass

from igrow_core.simulator.network import Stage


@dataclass(frozen=True)
class CropStages:
    """Growth hour by hour, and the harvest day by day."""

    growth: Stage
    """Predicts `quantities.GROWTH` from `GROWTH_DRIVERS`."""
    harvest: Stage
    """Predicts `quantities.YIELD` from `HARVEST_DRIVERS`."""


GROWTH_DRIVERS = ("par", "air_temperature", "air_co2")
"""Hourly means of the climate."""
HARVEST_DRIVERS = ("air_temperature", "plant_load", "growth_of_day")
"""Means of the day; the last is the day's net growth in kg m-2."""
