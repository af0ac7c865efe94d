"""A season under strategies: typical days through the simulator, every day through the crop, the balance at the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats
from igrow.core.economics import Balance, harvest_income, local_days, running_costs
from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import Crop
from igrow.core.planner.objective import DISBELIEF, OUTSIDE_PENALTY, damp_hours
from igrow.core.planner.season.crop import fresh, like, live, supplied
from igrow.core.planner.season.strategy import Strategy
from igrow.core.planner.template import Setpoints, Template, for_site
from igrow.core.quantities import SETPOINTS, WEATHER
from igrow.core.simulator.outcome import Initial, Outcome, Simulator
from igrow.core.site import Site

DAY = np.timedelta64(86_400, "s")
STRETCH = 10
"""Days whose weather is lived as two typical days, each for half of them."""
SUN_WARMS = 0.1
"""Sol-air temperature above that of the air for each W m-2 of global radiation, K."""
OUTDOOR, RADIATION, WIND = (WEATHER.index(name) for name in ("outdoor_temperature", "global_radiation", "wind_speed"))
PASSES = 2
"""Runs of all days until each knows how warm the one before was; a third moves net profit by less than 0.01 EUR m-2."""
MORNING = {"air_temperature": 18.0, "air_humidity": 80.0, "air_co2": 600.0, "leaf_area_index": 3.0}
"""Where the day before a typical one begins, at local midnight."""


@dataclass(frozen=True)
class TypicalDay:
    """A day, and the days that are like it."""

    first: int
    """Of the days that are like it, counted from the season's start."""
    days: int
    """How many are like it."""
    start: np.datetime64
    """UTC of the first day's local midnight."""
    weather: Floats
    """Its, (24, 6)."""
    template: Template
    """Of the day, twice."""


@dataclass(frozen=True)
class Season:
    """A season to be planned."""

    site: Site
    simulator: Simulator
    plant: GreenhouseParameters
    """The crop's parameters."""
    start: np.datetime64
    """UTC of the first day's local midnight."""
    days: int
    weather: Floats
    """Of typical days, (T, 24, 6): the first stands for the first `every` days, and so on."""
    every: int
    """Days for which a typical one stands; the last for those that are left."""
    recipe: Setpoints
    """The grower's day, (24, S), for what strategies say nothing of."""
    first_day: int = 0
    """Day of the season on which the start lies; the strategies' days are counted from the season's beginning."""

    def __post_init__(self) -> None:
        """Raise ValueError where days are left without weather."""
        if len(self.weather) * self.every < self.days:
            raise ValueError(f"{len(self.weather)} typical days for {self.every} days each leave some of {self.days}")

    @cached_property
    def typical_days(self) -> tuple[TypicalDay, ...]:
        """What its days are like, in their order."""
        found = []
        for first in range(0, self.days, self.every):
            start, weather = self.start + first * DAY, self.weather[first // self.every]
            template = for_site(self.site, start, 48, radiation=np.tile(weather[:, RADIATION], 2))
            found.append(TypicalDay(first, min(self.every, self.days - first), start, weather, template))
        return tuple(found)


@dataclass(frozen=True)
class SeasonOutcome:
    """What B strategies bring, EUR m-2; net profit counts only fruit that was ripe and harvested."""

    balance: Balance
    harvest: Floats
    """kg m-2, (B,)."""
    penalty: Floats
    """For leaving the range of the training data, EUR m-2, (B,)."""
    damp: Floats
    """Hours of each typical day that are expected to be damp, (T, B)."""
    crop: Crop
    """At the end."""
    used: dict[str, Floats]
    """heat (MJ m-2), electricity (kWh m-2), co2 and net_growth (kg m-2), (B,)."""
    crops: tuple[Crop, ...]
    """On the first of the days that each typical one stands for."""


def run_season(season: Season, strategy: Strategy, genes: NDArray[np.float32], crop: Crop) -> SeasonOutcome:
    """Return what strategies (B, G) bring from a crop on, which may be one for all or (B,) of one strategy."""
    site, p = season.site, season.plant
    count = max(len(genes), np.shape(crop.leaf)[0] if np.ndim(crop.leaf) else 1)
    plants = crop if np.ndim(crop.leaf) else like(crop, count)
    planted = fresh(p, plants)
    parts: list[Balance] = []
    used = {name: np.zeros(count) for name in ("heat", "electricity", "co2", "net_growth")}
    penalty = np.zeros(count)
    damp, crops = [], []
    wanted = [
        asked(strategy, genes, season.first_day + one.first + one.days // 2, one.template, one.weather, season.recipe)
        for one in season.typical_days
    ]
    for typical, outcome in zip(season.typical_days, _lived(season, wanted), strict=True):
        crops.append(plants)
        repeats = typical.days
        gross = supplied(p, believed(outcome), outcome.air_temperature[0])
        supply, warm, leaves = (
            np.broadcast_to(one, (count, 24)) for one in (gross, outcome.air_temperature[0], outcome.leaf_area_index[0])
        )
        time = typical.start + np.arange(24) * np.timedelta64(3600, "s")
        heat, electricity, co2 = (
            np.tile(getattr(outcome, name)[0], (1, repeats)) for name in ("heat", "electricity", "co2")
        )
        hours = np.tile(time, repeats)
        # The price of CO2 rises with what the crop has had.
        parts.append(
            running_costs(
                site.prices, site.time_zone, hours, heat, electricity, co2, site.crop.stem_density, used["co2"]
            )
        )
        used = {name: before + repeats * getattr(outcome, name)[0].sum(axis=-1) for name, before in used.items()}
        penalty = penalty + repeats * OUTSIDE_PENALTY * outcome.outside[0].sum(axis=-1) / 24.0
        damp.append(np.broadcast_to(damp_hours(outcome, site), count))
        for day in range(typical.first, typical.first + repeats):
            before = fresh(p, plants)
            plants = live(p, plants, supply, warm, leaves)
            if (day + season.first_day) % max(int(p.deleafing_interval), 1) == 0:
                plants = tomato.deleaf(np, p, plants)
            picked = fresh(p, plants) - before
            when = local_days(np.array([season.start + day * DAY + DAY // 2]), site.time_zone)
            income = harvest_income(site.prices, when, picked, 0.0 * picked, site.crop.brix)
            nothing = np.zeros(count)
            parts.append(Balance(income, nothing, nothing, nothing, nothing, nothing))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return SeasonOutcome(total, fresh(p, plants) - planted, penalty, np.stack(damp), plants, used, tuple(crops))


def bearable_damp(season: Season) -> Floats:
    """Return how many hours of each typical day may be damp, (T,): as many as the crop bears, or the recipe has."""
    lived = _lived(season, [season.recipe[None]] * len(season.typical_days))
    damp = [float(damp_hours(outcome, season.site)[0]) for outcome in lived]
    return np.maximum(damp, season.site.crop.agronomy.damp_hours)


def typical_days(days: Floats) -> Floats:
    """Return the typical cold and the typical mild one of days (D, 24, 6), (2, 24, 6).

    Heat is needed on cold days alone, so that a mean day needs less than days do on the mean. Days are halved by their
    sol-air temperature; of each half the one is taken that is nearest to its mean in warmth, sun and wind.
    """
    mean = days.mean(axis=1)
    order = np.argsort(mean[:, OUTDOOR] + SUN_WARMS * mean[:, RADIATION], kind="stable")
    half = -(-len(days) // 2)
    return np.stack([_nearest(days[order[:half]]), _nearest(days[order[-half:]])])


def _nearest(days: Floats) -> Floats:
    """Return the one of days (D, 24, 6) that is nearest to their mean in warmth, sun and wind, (24, 6)."""
    means = days.mean(axis=1)
    away = ((means - means.mean(axis=0)) / np.maximum(means.std(axis=0), 1e-9))[:, [OUTDOOR, RADIATION, WIND]]
    day: Floats = days[int(np.argmin((away**2).sum(axis=1)))]
    return day


def believed(outcome: Outcome) -> Floats:
    """Return the net growth (B, H) of the first member, less of it outside of the training data."""
    return np.asarray(outcome.net_growth[0] * np.clip(1.0 - DISBELIEF * outcome.outside[0], 0.0, 1.0))


def _lived(season: Season, wanted: Sequence[Setpoints]) -> list[Outcome]:
    """Return each typical day under its setpoints, (B, 24, S) each, lived once before.

    The day before is like it: the night that ends in the morning has had its dark hours, or has not, and air and floor
    begin as warm as the setpoints leave them. A morning that is the same for all gives to a cool strategy, for nothing,
    a tenth of the heat that it needs.

    The soil is as warm as the air was on the typical day before, on the first one as the heating setpoint asks. So that
    all days run at once, they are run `PASSES` times: first with each day's own heating setpoint for that warmth, then
    with what was found.
    """
    count = len(wanted[0])
    courses = np.concatenate(
        [
            one.template.follow(np.tile(day, (1, 2, 1)), np.full(len(SETPOINTS), np.nan)).setpoints
            for one, day in zip(season.typical_days, wanted, strict=True)
        ]
    )
    weather = np.repeat(np.stack([np.tile(one.weather, (2, 1)) for one in season.typical_days]), count, axis=0)
    start = np.repeat(np.array([one.start - DAY for one in season.typical_days]), count)
    warmth = np.stack([day[:, :, SETPOINTS.index("heating_setpoint")].mean(axis=1) for day in wanted])
    for _ in range(PASSES):
        morning: Initial = {**MORNING, "mean_air_temperature": warmth.ravel()}
        lived = season.simulator.simulate(morning, weather, courses, start).last(24)
        warmth[1:] = lived.air_temperature[0].mean(axis=-1).reshape(warmth.shape)[:-1]
    return [lived.of(slice(first, first + count)) for first in range(0, len(courses), count)]


def asked(
    strategy: Strategy, genes: NDArray[np.float32], day: float, template: Template, weather: Floats, recipe: Setpoints
) -> Setpoints:
    """Return what strategies ask of a day, (B, 24, S), whose hours are the first 24 of a template."""
    moments = template.moments[:24]
    local_hour = np.array([one.clock for one in moments])
    sun_up = np.array([one.sun_up for one in moments])
    return strategy.setpoints(genes, day, local_hour, sun_up, weather, recipe)
