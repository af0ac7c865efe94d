"""What a crop earns and costs, per m2 of growing area, by the rules of the second Autonomous Greenhouse Challenge.

Source: S. Hemming, Economics.pdf in doi:10.4121/uuid:88d22c60-21b3-4ea8-90db-20249a5be2a7 (2020). Net profit is
income less fixed costs (plants) less variable costs (upkeep of the stems, electricity by local hour, heat, CO2 in
tiers cumulated over the crop). Capital, real labour, sales and water are left out there, and here.

Arrays broadcast; amounts are per m2 of growing area, money is EUR.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from igrow.core.arrays import Floats, Mask, Times
from igrow.core.local_time import hour_of_day, to_local
from igrow.core.site import Prices


@dataclass(frozen=True)
class Balance:
    """Money per m2 of growing area, EUR m-2; each number may be an array over candidates."""

    income: Floats
    plants: Floats
    upkeep: Floats
    electricity: Floats
    heat: Floats
    co2: Floats

    @property
    def costs(self) -> Floats:
        """All costs, EUR m-2."""
        return self.plants + self.upkeep + self.electricity + self.heat + self.co2

    @property
    def net_profit(self) -> Floats:
        """Income less all costs, EUR m-2."""
        return self.income - self.costs

    def __add__(self, other: Balance) -> Balance:
        names = [field.name for field in fields(self)]
        return Balance(**{name: getattr(self, name) + getattr(other, name) for name in names})


def product_price(prices: Prices, local_time: Times, brix: ArrayLike) -> Floats:
    """Return the price of class A in EUR kg-1 at local times and a quality in degree Brix.

    The price is linear in Brix, p = price + per_brix (brix - reference_brix). That it is linear between the two
    published qualities is read from a figure of the source, not stated in it.
    """
    starts = np.array([price.start for price in prices.product], dtype="datetime64[D]")
    row = np.searchsorted(starts, np.asarray(local_time).astype("datetime64[D]"), side="right") - 1
    row = np.maximum(row, 0)
    base = np.array([price.price for price in prices.product])[row]
    slope = np.array([price.per_brix for price in prices.product])[row]
    return np.asarray(base + slope * (np.asarray(brix, dtype=np.float64) - prices.reference_brix))


def is_peak(prices: Prices, hour: ArrayLike) -> Mask:
    """Tell whether local hours (0 to 24) have the peak price; peak hours may run over midnight."""
    tariff = prices.electricity
    start = tariff.peak_start.hour + tariff.peak_start.minute / 60
    end = tariff.peak_end.hour + tariff.peak_end.minute / 60
    hours = np.asarray(hour, dtype=np.float64)
    if start <= end:
        return np.asarray((hours >= start) & (hours < end))
    return np.asarray((hours >= start) | (hours < end))


def electricity_price(prices: Prices, time: Times, time_zone: str) -> Floats:
    """Return the price of electricity in EUR kWh-1 at UTC times."""
    peak = is_peak(prices, hour_of_day(time, time_zone))
    return np.where(peak, prices.electricity.peak, prices.electricity.off_peak)


def co2_cost(prices: Prices, before: ArrayLike, used: ArrayLike) -> Floats:
    """Return the cost in EUR m-2 of `used` kg m-2 of CO2 when the crop has had `before` kg m-2 already."""
    before = np.asarray(before, dtype=np.float64)
    after = before + np.asarray(used, dtype=np.float64)
    cost = np.zeros(np.broadcast(before, after).shape)
    low = 0.0
    for tier in prices.co2:
        high = np.inf if tier.up_to is None else tier.up_to
        cost = cost + tier.price * (np.clip(after, low, high) - np.clip(before, low, high))
        low = high
    return cost


def running_costs(
    prices: Prices,
    time_zone: str,
    time: Times,
    heat: Floats,
    electricity: Floats,
    co2: Floats,
    stem_density: float,
    co2_before: ArrayLike = 0.0,
) -> Balance:
    """Return what a stretch of regular hours costs, summed over its last axis.

    `time` (UTC, shape (H,)) are the starts of the hours; `heat` MJ m-2, `electricity` kWh m-2 and `co2` kg m-2 are
    used in each, shape (..., H); `stem_density` in stems m-2; `co2_before` in kg m-2 is what the crop has had.
    """
    total_co2 = np.sum(co2, axis=-1)
    nothing = np.zeros(np.shape(total_co2))
    return Balance(
        income=nothing,
        plants=nothing,
        upkeep=nothing + prices.stem_day * stem_density * len(time) / 24.0,
        electricity=np.sum(electricity * electricity_price(prices, time, time_zone), axis=-1),
        heat=prices.heat * np.sum(heat, axis=-1),
        co2=co2_cost(prices, co2_before, total_co2),
    )


def harvest_income(prices: Prices, local_time: Times, class_a: Floats, class_b: Floats, brix: ArrayLike) -> Floats:
    """Return the income in EUR m-2 of each harvest: local times, kg m-2 of class A and B, degree Brix."""
    return product_price(prices, local_time, brix) * (class_a + prices.class_b * class_b)


def local_days(time: Times, time_zone: str) -> Times:
    """Return the local day of UTC times, datetime64[D]."""
    return to_local(time, time_zone).astype("datetime64[D]")
