"""The crop, and what harms it."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from dataclasses import dataclass

from igrow.core.site.agronomy import Agronomy
from igrow.core.yaml_schema import SettingError, setting


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
