"""What stands in a greenhouse: the building, its equipment and its sensors."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.yaml_schema import setting


@dataclass(frozen=True)
class Screen:
    """A movable screen."""

    saving: float = setting(unit="1", low=0, high=1, default=0.45, help="part of the cover's heat loss it saves")
    transmissivity: float = setting(unit="1", low=0, high=1, default=0.75, help="part of the light it lets through")


@dataclass(frozen=True)
class Lamps:
    """The lamps, all together."""

    power: float = setting(unit="W m-2", low=0, high=500, default=81.0, help="electric power per floor area")
    efficacy: float = setting(unit="umol J-1", low=0.1, high=5, default=1.24, help="PAR per electric energy")


@dataclass(frozen=True)
class Greenhouse:
    """Building and equipment; areas are per floor area where the unit is 1."""

    floor_area: float = setting(unit="m2", low=1, high=1e6, default=62.5, help="growing area")
    mean_height: float = setting(unit="m", low=1, high=20, default=5.0, help="air volume per floor area")
    cover_area_ratio: float = setting(unit="1", low=1, high=5, default=1.2, help="cover and walls per floor area")
    cover_transmissivity: float = setting(
        unit="1", low=0.1, high=1, default=0.5, help="PAR above the crop per PAR outside, screens open"
    )
    cover_heat_transfer: float = setting(
        unit="W m-2 K-1", low=0.5, high=15, default=6.0, help="heat loss per cover area, screens open"
    )
    leakage: float = setting(
        unit="m3 m-2 s-1 per m s-1", low=0, high=0.01, default=1.2e-4, help="air leaking in per floor area and wind"
    )
    vent_area_ratio: float = setting(unit="1", low=0, high=1, default=0.15, help="largest vent opening, all sides")
    energy_screen: Screen | None = setting(help="energy screen, or null", default_factory=Screen)
    blackout_screen: Screen | None = setting(
        help="blackout screen, or null", default_factory=lambda: Screen(saving=0.45, transmissivity=0.02)
    )
    lamps: Lamps | None = setting(help="lamps, or null", default_factory=Lamps)
    rail_pipe_heat_transfer: float = setting(
        unit="W m-2 K-1", low=0, high=20, default=2.1, help="heat from the pipe rail per floor area and kelvin"
    )
    grow_pipe_heat_transfer: float = setting(
        unit="W m-2 K-1", low=0, high=20, default=0.62, help="heat from the grow pipe per floor area and kelvin"
    )
    heating_capacity: float = setting(unit="W m-2", low=0, high=1000, default=200.0, help="most heat of the pipes")
    co2_dosing_capacity: float = setting(unit="kg m-2 h-1", low=0, high=0.1, default=0.015, help="most CO2 dosed")


@dataclass(frozen=True)
class Sensor:
    """How well a quantity is measured."""

    noise: float = setting(low=0, default=0.0, help="standard deviation of one reading, in the quantity's unit")
    resolution: float = setting(low=0, default=0.0, help="smallest step of a reading, in the quantity's unit")
    interval: datetime.timedelta = setting(
        low=datetime.timedelta(seconds=1),
        high=datetime.timedelta(hours=1),
        default=datetime.timedelta(minutes=5),
        help="time between readings that are kept",
    )


def default_sensors() -> Mapping[str, Sensor]:
    """Return the sensors of the compartments that the defaults describe: noise and resolution."""
    table = {
        "outdoor_temperature": (0.1, 0.1),
        "outdoor_humidity": (1.0, 0.1),
        "outdoor_co2": (5.0, 1.0),
        "global_radiation": (5.0, 1.0),
        "wind_speed": (0.2, 0.1),
        "wind_direction": (5.0, 1.0),
        "sky_temperature": (0.5, 0.1),
        "rain": (0.0, 1.0),
        "air_temperature": (0.1, 0.1),
        "air_humidity": (0.6, 0.1),
        "air_co2": (8.0, 1.0),
        "par": (5.0, 1.0),
    }
    return {name: Sensor(noise, resolution) for name, (noise, resolution) in table.items()}
