"""What a candidate is worth, from what the simulator says it does, per m2.

A plan of two days harvests fruit that grew long before, so the harvest within the horizon says nothing about the
plan. What a plan makes is growth. Growth is worth the fruit that it becomes:

    value = growth * fruit_share / dry_matter_fraction * price_of_growth(t)

where `price_of_growth` is the product's price averaged over the days on which the fruit now on the plant ripens.
Fruit of every age takes up growth, so those days are spread evenly from now to `days_to_harvest`; the part that
falls behind the crop's end date is worth nothing (unripe fruit is not sold), and a discount is taken off for the risk
of the wait. A cold day's growth is worth less, the less the colder (`igrow.core.agronomy.cold`). This leaves out that
warm air ripens fruit sooner and that a plant without fruit cannot use growth.

Costs are those of `igrow.core.economics`, with CO2 in tiers from what the crop has had before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from igrow.core.agronomy.cold import worth_of_growth
from igrow.core.air import saturation_pressure
from igrow.core.arrays import Floats, Times
from igrow.core.economics import Balance, local_days, product_price, running_costs
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Site

HARM_PER_DEGREE_HOUR = 0.002
"""EUR m-2 for each kelvin and hour outside the crop's bounds, and each % of humidity and hour above its bound."""
DISBELIEF = 2.0
"""Growth promised outside the training data counts less by this much for each width of the range: half a width
outside it counts for nothing. A network may promise any growth there, and a search finds where it does."""
OUTSIDE_PENALTY = 0.2
"""EUR m-2 for a day spent one width of the range outside the data that the simulator knows: more than a plan of a
day can hope to gain."""


class Worth(Protocol):
    """Says what outcomes are worth to the crop."""

    def income(self, outcome: Outcome, time: Times) -> Floats:
        """Return EUR m-2 over the horizon, (M, B); `time` are the UTC starts of its hours, (H,)."""


@dataclass(frozen=True)
class Valuation:
    """What B candidates are worth over the horizon, EUR m-2, by each of M members: arrays (M, B)."""

    balance: Balance
    """Income is the value of growth."""
    harm: Floats
    """Penalty for climate that harms the crop."""
    outside: Floats
    """Penalty for leaving the range of the training data."""

    @property
    def profit(self) -> Floats:
        """Value of growth less costs, (M, B); penalties are not money and stay out of it."""
        return self.balance.net_profit

    @property
    def score(self) -> Floats:
        """Profit less penalties, (M, B)."""
        return self.profit - self.harm - self.outside


@dataclass(frozen=True)
class Objective:
    """The value of outcomes at one site over one stretch of hours."""

    site: Site
    time: Times
    """UTC starts of the hours, (H,)."""
    co2_before: Floats | float = 0.0
    """kg m-2 of CO2 that the crop has had before; one value, or one for each candidate, (B,)."""
    worth: Worth | None = None
    """What the crop's growth is worth; None takes the average price of the days on which fruit now growing ripens."""

    def first(self, hours: int) -> Objective:
        """Return the value of the first hours alone."""
        return replace(self, time=self.time[:hours])

    def value(self, outcome: Outcome) -> Valuation:
        """Return what the candidates are worth."""
        site, crop = self.site, self.site.crop
        costs = running_costs(
            site.prices,
            site.time_zone,
            self.time,
            outcome.heat,
            outcome.electricity,
            outcome.co2,
            crop.stem_density,
            self.co2_before,
        )
        income = self._income(outcome) if self.worth is None else self.worth.income(outcome, self.time)
        return Valuation(
            balance=Balance(income, costs.plants, costs.upkeep, costs.electricity, costs.heat, costs.co2),
            harm=self._harm(outcome),
            outside=OUTSIDE_PENALTY * np.sum(outcome.outside, axis=-1) / 24.0,
        )

    def _income(self, outcome: Outcome) -> Floats:
        crop = self.site.crop
        believed = outcome.net_growth * np.clip(1.0 - DISBELIEF * outcome.outside, 0.0, 1.0)
        fresh = believed * (crop.fruit_share / crop.dry_matter_fraction)
        return np.asarray(np.sum(fresh * by_day(outcome.air_temperature) * self.growth_price(), axis=-1))

    def growth_price(self) -> Floats:
        """Return what fresh fruit growing in each hour will earn on average, EUR kg-1, (H,)."""
        site, crop = self.site, self.site.crop
        day = local_days(self.time, site.time_zone)
        ahead = np.arange(max(1, round(crop.days_to_harvest)))
        ripe = day[:, None] + ahead[None, :].astype("timedelta64[D]")
        price = product_price(site.prices, ripe, crop.brix)
        if crop.end_date is not None:
            price = np.where(ripe <= np.datetime64(crop.end_date), price, 0.0)
        return np.asarray(price.mean(axis=1) * (1.0 - site.planning.discount))

    def _harm(self, outcome: Outcome) -> Floats:
        crop, air = self.site.crop, outcome.air_temperature
        hot = np.maximum(air - crop.temperature_high, 0.0)
        cold = np.maximum(crop.temperature_low - air, 0.0)
        damp = np.maximum(outcome.air_humidity - crop.humidity_high, 0.0)
        harm = HARM_PER_DEGREE_HOUR * np.sum(hot + cold + damp, axis=-1)
        return np.asarray(harm)


def by_day(air_temperature: Floats) -> Floats:
    """Return for each hour (..., H) what the growth of its day is worth at that day's mean temperature, 0 to 1."""
    worth = np.empty_like(air_temperature)
    for first in range(0, air_temperature.shape[-1], 24):
        day = slice(first, first + 24)
        worth[..., day] = worth_of_growth(air_temperature[..., day].mean(axis=-1))[..., None]
    return worth


def damp_hours(outcome: Outcome, site: Site) -> Floats:
    """Return how many hours of the worst day are expected to be damp, mean over the ensemble, (B,)."""
    crop = site.crop
    deficit = saturation_pressure(np, outcome.air_temperature) * (1.0 - outcome.air_humidity / 100.0) * 1e-3
    damp = (outcome.air_humidity > crop.humidity_high) | (deficit < crop.agronomy.deficit_low)
    days = [damp[..., first : first + 24].sum(axis=-1) for first in range(0, damp.shape[-1], 24)]
    return np.asarray(np.max(np.stack(days), axis=0).mean(axis=0))


def cautious(valuation: Valuation, reference: Valuation, caution: float) -> tuple[Floats, Floats]:
    """Return what the candidates gain over the reference, taking doubt off, and the doubt itself; both (B,).

    The members of an ensemble err together on much that plan and reference share, so the doubt is the standard
    deviation of the gain over the members, not of the profit: mean gain - caution * sd(gain), EUR m-2.
    """
    gain = valuation.score - reference.score
    doubt = gain.std(axis=0)
    return gain.mean(axis=0) - caution * doubt, doubt
