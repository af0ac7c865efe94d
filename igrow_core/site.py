"""A site: one greenhouse with its place, equipment, crop, prices, limits and paces, as a grower writes it down.

Only the name and the place are required. Every other value has the default of the cherry tomato compartments of
the second Autonomous Greenhouse Challenge (2019/2020, doi:10.4121/uuid:88d22c60-21b3-4ea8-90db-20249a5be2a7),
so that a file of ten lines describes a greenhouse. Its prices are those of that challenge's economics document.
"""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise

from igrow.core import yaml_schema
from igrow.core.agronomy.limits import Agronomy
from igrow.core.errors import IgrowError
from igrow.core.language.units import Units
from igrow.core.local_time import zone
from igrow.core.quantities import ACTUATORS, CLIMATE, QUANTITIES, SETPOINTS, WEATHER
from igrow.core.yaml_schema import SettingError, setting


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


@dataclass(frozen=True)
class Crop:
    """The crop."""

    species: str = setting(default="tomato", help="what grows")
    planting_date: datetime.date = setting(default=datetime.date(2019, 12, 16), help="day of planting")
    end_date: datetime.date | None = setting(default=None, help="last day of the crop, or null")
    plant_density: float = setting(unit="plants m-2", low=0.1, high=50, default=1.4, help="plants per floor area")
    stem_density: float = setting(unit="stems m-2", low=0.1, high=50, default=3.0, help="stems per floor area")
    dry_matter_fraction: float = setting(
        unit="1", low=0.02, high=0.3, default=0.09, help="dry weight of a fruit per fresh weight"
    )
    fruit_share: float = setting(
        unit="1", low=0.1, high=1, default=0.7, help="part of the net growth, in dry matter, that goes to fruit"
    )
    brix: float = setting(unit="degree Brix", low=2, high=15, default=8.5, help="expected quality of the fruit")
    days_to_harvest: float = setting(
        unit="days", low=1, high=120, default=47, help="from a fruit's setting to its harvest"
    )
    temperature_low: float = setting(unit="degC", low=0, high=30, default=13.0, help="colder air harms the crop")
    temperature_high: float = setting(unit="degC", low=15, high=50, default=32.0, help="hotter air harms the crop")
    humidity_high: float = setting(unit="%", low=50, high=100, default=93.0, help="damper air invites disease")
    agronomy: Agronomy = setting(help="what no plan may leave", default_factory=Agronomy)

    def __post_init__(self) -> None:
        if self.end_date is not None and self.end_date < self.planting_date:
            raise SettingError(f"end_date {self.end_date} lies before planting_date {self.planting_date}", "end_date")
        if self.temperature_low >= self.temperature_high:
            told = f"temperature_low {self.temperature_low:g} is not below temperature_high {self.temperature_high:g}"
            raise SettingError(told, "temperature_low")

    @property
    def unlike_its_species(self) -> str:
        """What is said of a crop that is no tomato and is described as one, in a sentence; empty for all others."""
        plain = Crop()
        told = ("dry_matter_fraction", "fruit_share", "days_to_harvest")
        same = [f"{name} ({getattr(self, name):g})" for name in told if getattr(self, name) == getattr(plain, name)]
        same += ["agronomy"] if self.agronomy == plain.agronomy else []
        if not same or self.species.lower() == plain.species:
            return ""
        return f"crop.species is {self.species}, but {', '.join(same)} are those of a tomato: state this crop's own"


@dataclass(frozen=True)
class ElectricityTariff:
    """Electricity by local hour."""

    peak: float = setting(unit="EUR kWh-1", low=0, high=5, default=0.08, help="price in peak hours")
    off_peak: float = setting(unit="EUR kWh-1", low=0, high=5, default=0.04, help="price in all other hours")
    peak_start: datetime.time = setting(default=datetime.time(7), help="local time at which peak hours begin")
    peak_end: datetime.time = setting(default=datetime.time(23), help="local time at which they end")


@dataclass(frozen=True)
class Tier:
    """One step of the price of CO2."""

    price: float = setting(unit="EUR kg-1", low=0, high=10, help="price within this tier")
    up_to: float | None = setting(
        unit="kg m-2", low=0, default=None, help="end of the tier, cumulated over the crop; null for the last"
    )


@dataclass(frozen=True)
class ProductPrice:
    """The price of the product from a day on."""

    start: datetime.date = setting(help="first local day of this price")
    price: float = setting(unit="EUR kg-1", low=0, high=100, help="price of class A at the reference quality")
    per_brix: float = setting(
        unit="EUR kg-1 per degree Brix", low=0, high=10, default=0.0, help="more for each degree above the reference"
    )


def _challenge_prices() -> tuple[ProductPrice, ...]:
    """Prices at Brix 6 and per degree above, for two weeks each (the last one for fifteen days)."""
    at_brix_6 = (3.0, 3.5, 3.5, 2.8, 2.5, 2.2, 2.0, 1.8, 1.6, 1.4, 1.2, 1.1)
    at_brix_10 = (5.0, 5.2, 4.5, 4.2, 3.8, 3.2, 2.8, 2.6, 2.4, 2.5, 2.6, 2.5)
    first = datetime.date(2020, 1, 1)
    return tuple(
        ProductPrice(first + datetime.timedelta(days=14 * step), low, round((high - low) / 4, 4))
        for step, (low, high) in enumerate(zip(at_brix_6, at_brix_10, strict=True))
    )


@dataclass(frozen=True)
class Prices:
    """What things cost and what the product earns."""

    heat: float = setting(unit="EUR MJ-1", low=0, high=1, default=0.0083, help="heat")
    electricity: ElectricityTariff = setting(help="electricity", default_factory=ElectricityTariff)
    co2: tuple[Tier, ...] = setting(
        help="CO2, in tiers cumulated over the crop", default_factory=lambda: (Tier(0.08, 12.0), Tier(0.20))
    )
    product: tuple[ProductPrice, ...] = setting(
        help="product by date; the first holds before it too, the last after it", default_factory=_challenge_prices
    )
    reference_brix: float = setting(unit="degree Brix", low=0, high=20, default=6.0, help="quality that `price` means")
    class_b: float = setting(unit="1", low=0, high=1, default=0.5, help="price of class B per price of class A")
    plant: float = setting(unit="EUR", low=0, high=100, default=2.20, help="one plant")
    stem_day: float = setting(unit="EUR", low=0, high=1, default=0.0085, help="upkeep of one stem for a day")

    def __post_init__(self) -> None:
        if not self.product:
            raise SettingError("product is empty: at least one price is needed", "product")
        for position in range(1, len(self.product)):
            if self.product[position].start <= self.product[position - 1].start:
                raise SettingError("the prices of the product must follow one another in time", "product", position)
        ends = [math.inf if tier.up_to is None else tier.up_to for tier in self.co2]
        if not ends or ends[-1] != math.inf or any(b <= a for a, b in pairwise(ends)):
            raise SettingError("the CO2 tiers must rise, and the last must have no up_to", "co2")


@dataclass(frozen=True)
class SetpointLimits:
    """What the guard allows for one setpoint, in the setpoint's unit."""

    low: float = setting(help="smallest value ever written")
    high: float = setting(help="largest value ever written")
    safe: float = setting(help="value written when control stops")
    slew: float | None = setting(low=0, default=None, help="most change per hour, or null")
    dead_band: float = setting(low=0, default=0.0, help="smaller changes are not written")
    minimum_interval: datetime.timedelta = setting(
        low=datetime.timedelta(0),
        high=datetime.timedelta(days=1),
        default=datetime.timedelta(minutes=5),
        help="least time between two writes",
    )

    def __post_init__(self) -> None:
        if self.low > self.high:
            raise SettingError(f"low {self.low:g} is above high {self.high:g}", "low")
        if not self.low <= self.safe <= self.high:
            raise SettingError(f"safe {self.safe:g} is outside low {self.low:g} to high {self.high:g}", "safe")


def _limits(low: float, high: float, safe: float, slew: float | None, dead_band: float, minutes: int) -> SetpointLimits:
    return SetpointLimits(low, high, safe, slew, dead_band, datetime.timedelta(minutes=minutes))


@dataclass(frozen=True)
class Limits:
    """The limits of the four setpoints."""

    heating_setpoint: SetpointLimits = setting(
        help="degC", default_factory=lambda: _limits(12.0, 28.0, 18.0, 4.0, 0.1, 5)
    )
    co2_setpoint: SetpointLimits = setting(
        help="ppm", default_factory=lambda: _limits(400.0, 1000.0, 400.0, 600.0, 10.0, 5)
    )
    lamp_on: SetpointLimits = setting(help="fraction", default_factory=lambda: _limits(0.0, 1.0, 0.0, None, 0.05, 30))
    irrigation_on: SetpointLimits = setting(
        help="fraction", default_factory=lambda: _limits(0.0, 1.0, 0.1, None, 0.02, 5)
    )

    def __post_init__(self) -> None:
        for field in fields(self):
            limits, quantity = self[field.name], QUANTITIES[field.name]
            for key, value in (("low", limits.low), ("high", limits.high)):
                if not quantity.holds(value):
                    span = f"{quantity.low:g} to {quantity.high:g} {quantity.unit}"
                    raise SettingError(f"{field.name}.{key} is {value:g}: {span} makes sense", field.name, key)

    def __getitem__(self, name: str) -> SetpointLimits:
        """Return the limits of a setpoint by its name."""
        if name not in SETPOINTS:
            raise IgrowError(f"{name} is no setpoint: {yaml_schema.nearest(name, SETPOINTS)}")
        limits: SetpointLimits = getattr(self, name)
        return limits


def _default_sensors() -> Mapping[str, Sensor]:
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


@dataclass(frozen=True)
class Planning:
    """How plans are made and models corrected."""

    replan_every: datetime.timedelta = setting(
        low=datetime.timedelta(minutes=30),
        high=datetime.timedelta(days=14),
        default=datetime.timedelta(hours=6),
        help="pace of the upper level, K1",
    )
    recalibrate_every: datetime.timedelta = setting(
        low=datetime.timedelta(days=1),
        high=datetime.timedelta(days=365),
        default=datetime.timedelta(days=7),
        help="pace of the lower level, K2",
    )
    horizon: datetime.timedelta = setting(
        low=datetime.timedelta(days=1),
        high=datetime.timedelta(days=14),
        default=datetime.timedelta(days=2),
        help="how far a plan looks ahead, in whole days",
    )
    optimise: tuple[str, ...] = setting(
        default=("heating_setpoint", "co2_setpoint", "lamp_on"),
        help="setpoints that plans choose; the others follow the recipe",
    )
    caution: float = setting(
        low=0, high=5, default=1.0, help="standard deviations of the simulator's doubt taken off a plan's profit"
    )
    discount: float = setting(
        unit="1", low=0, high=1, default=0.2, help="taken off the value of fruit that is not yet ripe"
    )

    def __post_init__(self) -> None:
        for position, name in enumerate(self.optimise):
            if name not in SETPOINTS:
                raise SettingError(f"optimise has {name}: {yaml_schema.nearest(name, SETPOINTS)}", "optimise", position)


@dataclass(frozen=True, repr=False)
class Site:
    """One greenhouse and all that the two sides must know of it."""

    name: str = setting(help="short name: small letters, digits and hyphens")
    latitude: float = setting(unit="deg", low=-90, high=90, help="north is positive")
    longitude: float = setting(unit="deg", low=-180, high=180, help="east is positive")
    time_zone: str = setting(default="UTC", help="IANA name, for people and tariffs")
    elevation: float = setting(unit="m", low=-500, high=5000, default=0.0, help="above the sea")
    greenhouse: Greenhouse = setting(help="building and equipment", default_factory=Greenhouse)
    sensors: Mapping[str, Sensor] = setting(
        help="what is measured, and how well",
        keys=(*WEATHER, *CLIMATE),
        default_factory=_default_sensors,
    )
    actuators: tuple[str, ...] = setting(help="actuators whose state the PLC reports", default=ACTUATORS)
    setpoints: tuple[str, ...] = setting(help="setpoints that the PLC takes", default=SETPOINTS)
    crop: Crop = setting(help="crop", default_factory=Crop)
    prices: Prices = setting(help="prices", default_factory=Prices)
    limits: Limits = setting(help="limits of the setpoints", default_factory=Limits)
    planning: Planning = setting(help="planning", default_factory=Planning)
    units: Units = setting(default="metric", help="what people read and write: metric, or us (degF, mph, ft2)")

    def __repr__(self) -> str:
        return f"Site({self.name!r}, {self.latitude:g}, {self.longitude:g}, {self.time_zone})"

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z0-9][a-z0-9-]{0,62}", self.name):
            needed = "small letters, digits and hyphens are needed, 63 at most"
            raise SettingError(f"name is {self.name!r}: {needed}", "name")
        try:
            zone(self.time_zone)
        except IgrowError as error:
            raise SettingError(str(error), "time_zone") from None
        self._check_agronomy()
        for key, known in (("actuators", ACTUATORS), ("setpoints", SETPOINTS)):
            for position, name in enumerate(getattr(self, key)):
                if name not in known:
                    raise SettingError(f"{key} has {name}: {yaml_schema.nearest(name, known)}", key, position)

    def _check_agronomy(self) -> None:
        """Raise SettingError where the limits of the heating setpoint leave nothing of what the crop needs."""
        crop, heating = self.crop.agronomy, self.limits.heating_setpoint
        for name in ("day_temperature", "night_temperature", "mean_temperature"):
            band = getattr(crop, name)
            if band.low > heating.high or band.high < heating.low:
                raise SettingError(
                    f"crop.agronomy.{name} is {band.low:g} to {band.high:g} degC, limits.heating_setpoint only allows "
                    f"{heating.low:g} to {heating.high:g}",
                    *("crop", "agronomy", name),
                )
        if not heating.low <= crop.anchor <= heating.high:
            raise SettingError(
                f"the crop needs {crop.anchor:g} degC by day and night, limits.heating_setpoint only allows "
                f"{heating.low:g} to {heating.high:g}",
                *("limits", "heating_setpoint"),
            )


def load_site(path: str | os.PathLike[str]) -> Site:
    """Read a site from its YAML file; raises SchemaError with file, line and column."""
    return yaml_schema.load(path, Site)
