"""One greenhouse and all that the two sides must know of it, from its YAML file."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.errors import IgrowError
from igrow.core.language.units import Units
from igrow.core.local_time import zone
from igrow.core.quantities import ACTUATORS, CLIMATE, SETPOINTS, USUAL_SETPOINTS, WEATHER
from igrow.core.site.control import Limits, Planning
from igrow.core.site.crop import Crop
from igrow.core.site.equipment import Greenhouse, Sensor, default_sensors
from igrow.core.site.prices import Prices
from igrow.core.yaml_scalars import nearest
from igrow.core.yaml_schema import SettingError, load, setting


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
        default_factory=default_sensors,
    )
    actuators: tuple[str, ...] = setting(help="actuators whose state the PLC reports", default=ACTUATORS)
    setpoints: tuple[str, ...] = setting(help="setpoints that the PLC takes", default=USUAL_SETPOINTS)
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
                    raise SettingError(f"{key} has {name}: {nearest(name, known)}", key, position)
        if "ventilation_setpoint" in self.setpoints:
            self._check_dead_zone()

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

    def _check_dead_zone(self) -> None:
        """Raise SettingError where heat and open vents could not be kept apart."""
        heating, vents, zone = self.limits.heating_setpoint, self.limits.ventilation_setpoint, self.crop.agronomy
        for key in ("high", "safe"):
            least = getattr(heating, key) + zone.dead_zone
            if getattr(vents, key) < least:
                raise SettingError(
                    f"limits.ventilation_setpoint.{key} is {getattr(vents, key):g} degC: at least {least:g} keeps it "
                    f"crop.agronomy.dead_zone above limits.heating_setpoint.{key}",
                    *("limits", "ventilation_setpoint", key),
                )


def load_site(path: str | os.PathLike[str]) -> Site:
    """Read a site from its YAML file; raises SchemaError with file, line and column."""
    return load(path, Site)
