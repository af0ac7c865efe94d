"""What things cost and what the product earns."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from itertools import pairwise

from igrow.core.yaml_schema import SettingError, setting


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
