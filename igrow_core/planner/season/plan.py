"""What a season's search leaves to the days: the strategy, the crop that it expects, and what that crop is worth.

A bundle carries it as `season.json`; the day's search takes its marginal values in place of an average price.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.bundle import Bundle, BundleError
from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.described import parameters_of
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.tomato import STAGES, Crop
from igrow.core.planner.evolution import Genes
from igrow.core.planner.season.course import DAY, Season, run_season
from igrow.core.planner.season.strategy import OPTIONAL, Strategy
from igrow.core.planner.season.worth import CropWorth, MarginalValues, marginal_values
from igrow.core.planner.template import Setpoints, Template
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Site

SEASON_FILE = "season.json"
FORMAT = 1
LARGEST_LOAD = 3.0
"""A counted load is believed up to so many times the one that the season expects, and down to its inverse."""


@dataclass(frozen=True)
class SeasonPlan:
    """A season from `start` on; the rows of all arrays belong to dates every `every` days."""

    start: np.datetime64
    """UTC of the first day's local midnight."""
    days: int
    every: int
    knots: int
    genes: Genes
    """Of the strategy, (G,)."""
    net_profit: float
    """That is expected of the whole season, EUR m-2, fruit picked less costs."""
    values: tuple[MarginalValues, ...]
    crops: tuple[Crop, ...]
    """As they are expected, one crop each: floats, and (STAGES,) for fruit."""
    weather: Floats
    """Of each date's typical day, a cold and a mild one in turn, hourly means in the registry's order, (D, 24, 6)."""
    optional: tuple[str, ...] = ()
    """Setpoints that not every PLC takes and the strategy says."""

    @property
    def strategy(self) -> Strategy:
        """How the genes become a day's numbers."""
        return Strategy(self.days, self.knots, optional=self.optional)

    def day_of(self, time: np.datetime64) -> float:
        """Return the day of the season at a UTC time, counted from its first."""
        return float((time - self.start) / DAY)

    def covers(self, time: np.datetime64) -> bool:
        """Tell whether the season runs at a UTC time."""
        return 0.0 <= self.day_of(time) < self.days

    def numbers(self, time: np.datetime64) -> dict[str, float]:
        """Return what the strategy says on the day of a UTC time, in a grower's terms."""
        said = self.strategy.numbers(self.genes[None], self.day_of(time))
        return {name: float(value[0]) for name, value in said.items()}

    def setpoints(self, template: Template, weather: Floats, recipe: Setpoints, time: np.datetime64) -> Setpoints:
        """Return what the strategy asks of a horizon of whole days from a UTC time on, (H, S), before any limit.

        Args:
            template: of the horizon.
            weather: that is expected, (H, 6).
            recipe: (H, S), for what a strategy says nothing of.
            time: at which the horizon begins.
        """
        days = []
        for first in range(0, len(weather), 24):
            hours = slice(first, first + 24)
            clock = np.array([one.clock for one in template.moments[hours]])
            sun_up = np.array([one.sun_up for one in template.moments[hours]])
            day = self.day_of(time) + first / 24.0
            days.append(self.strategy.setpoints(self.genes[None], day, clock, sun_up, weather[hours], recipe[hours])[0])
        asked = np.concatenate(days)
        # A site may have given up a setpoint since.
        for name in self.optional:
            if name not in template.free:
                column = SETPOINTS.index(name)
                asked[:, column] = recipe[:, column]
        return asked

    def typical_weather(self, time: np.datetime64, hours: int) -> Floats:
        """Return the weather that is usual from a UTC time on, (hours, 6): the mean of the stretch's two days."""
        ahead = time + np.arange(hours) * np.timedelta64(3600, "s")
        since = ((ahead - self.start) / np.timedelta64(3600, "s")).astype(np.int64)
        cold = np.clip(since // (24 * self.every), 0, len(self.weather) - 1) // 2 * 2
        mild = np.minimum(cold + 1, len(self.weather) - 1)
        return np.asarray(0.5 * (self.weather[cold, since % 24] + self.weather[mild, since % 24]))

    def worth(
        self, site: Site, time: np.datetime64, present: Mapping[str, float], warmth: float | None = None
    ) -> CropWorth | None:
        """Return what the crop of a site is worth at a UTC time; None outside of the season.

        Args:
            site: whose prices and greenhouse they are.
            time: at which a horizon begins.
            present: leaf_area_index and plant_load as counted, where they were.
            warmth: mean air temperature of the last day, degC, where it is known.
        """
        if not self.covers(time):
            return None
        plant = parameters_of(site)
        place = self.day_of(time) / self.every
        left = min(int(place), len(self.values) - 1)
        right = min(left + 1, len(self.values) - 1)
        share = place - int(place)
        crop = _counted(plant, _between(self.crops[left], self.crops[right], share), present)
        if warmth is not None and np.isfinite(warmth):
            crop = crop._replace(mean_temperature=np.float64(warmth))
        one, other = self.values[left], self.values[right]
        values = MarginalValues(
            *(getattr(one, name) * (1.0 - share) + getattr(other, name) * share for name in ("buffer", "leaf", "fruit"))
        )
        return CropWorth(site, plant, crop, values)

    def to_json(self) -> str:
        """Return it as text."""
        content = {
            "format": FORMAT,
            "start": f"{self.start.astype('datetime64[s]')}Z",
            "days": self.days,
            "every": self.every,
            "knots": self.knots,
            "genes": [round(float(gene), 6) for gene in self.genes],
            "net_profit": self.net_profit,
            "values": [
                {"buffer": one.buffer, "leaf": one.leaf, "fruit": one.fruit.tolist()} for one in self.values
            ],
            "weather": np.round(self.weather, 2).tolist(),
            "crops": [{name: np.asarray(part).tolist() for name, part in one._asdict().items()} for one in self.crops],
        }  # fmt: skip
        return json.dumps(content | ({"optional": self.optional} if self.optional else {}))

    @classmethod
    def from_json(cls, text: str, where: str) -> SeasonPlan:
        """Return that of a text; raises BundleError, with `where`, where it is none."""
        try:
            given: dict[str, Any] = json.loads(text)
            if given["format"] != FORMAT:
                raise BundleError(f"{where}: is of format {given['format']}; this version reads {FORMAT}")
            plan = cls(
                np.datetime64(given["start"].removesuffix("Z"), "s"),
                int(given["days"]),
                int(given["every"]),
                int(given["knots"]),
                np.array(given["genes"], dtype=np.float32),
                float(given["net_profit"]),
                tuple(
                    MarginalValues(float(one["buffer"]), float(one["leaf"]), np.array(one["fruit"], dtype=np.float64))
                    for one in given["values"]
                ),
                tuple(
                    Crop(**{name: np.asarray(part, dtype=np.float64) for name, part in one.items()})
                    for one in given["crops"]
                ),
                np.array(given["weather"], dtype=np.float64),
                tuple(given.get("optional", ("humidity_setpoint",) if given.get("humidity") else ())),
            )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise BundleError(f"{where}: is no season: {error}") from None
        if unknown := [name for name in plan.optional if name not in OPTIONAL]:
            raise BundleError(
                f"{where}: its strategy says {', '.join(map(str, unknown))}, which this version does not know"
            )
        whole = len(plan.values) == len(plan.crops) == len(plan.weather) > 0 and len(plan.genes) == plan.strategy.genes
        if not whole or plan.weather.shape[1:] != (24, 6) or any(one.fruit.shape != (STAGES,) for one in plan.values):
            raise BundleError(f"{where}: is no season: its parts do not fit each other")
        return plan

    @classmethod
    def of(cls, bundle: Bundle) -> SeasonPlan | None:
        """Return that of a bundle; None where it carries none. Raises BundleError where it cannot be read."""
        if SEASON_FILE not in bundle.manifest.files:
            return None
        return cls.from_json(bundle.content(SEASON_FILE).decode(), str(bundle.folder / SEASON_FILE))


def valued(season: Season, strategy: Strategy, genes: Genes, crop: Crop) -> SeasonPlan:
    """Return the plan of a season under one strategy (G,), which a crop begins: its values at each typical day."""
    outcome = run_season(season, strategy, genes[None], crop)
    crops = tuple(_one(each) for each in outcome.crops)
    values = tuple(
        marginal_values(
            replace(
                season,
                start=season.start + place * season.every * DAY,
                days=season.days - place * season.every,
                weather=season.weather[place:],
                first_day=season.first_day + place * season.every,
            ),
            strategy,
            genes,
            each,
        )
        for place, each in enumerate(crops)
    )
    net_profit = float(outcome.balance.net_profit[0])
    weather = season.weather[: len(crops)]
    return SeasonPlan(
        season.start, season.days, season.every, strategy.knots, genes, net_profit, values, crops, weather,
        strategy.optional,
    )  # fmt: skip


def _one(crop: Crop) -> Crop:
    """Return the only crop of a batch of one."""
    return Crop(*(np.asarray(part)[..., 0] for part in crop))


def _between(one: Crop, other: Crop, share: float) -> Crop:
    return Crop(*(np.asarray(a) * (1.0 - share) + np.asarray(b) * share for a, b in zip(one, other, strict=True)))


def _counted(plant: GreenhouseParameters, crop: Crop, present: Mapping[str, float]) -> Crop:
    """Return the crop with the leaves and the fruit that were counted, where they were."""
    area, load = present.get("leaf_area_index", np.nan), present.get("plant_load", np.nan)
    if np.isfinite(area) and area > 0.0:
        crop = crop._replace(leaf=np.float64(area / plant.specific_leaf_area))
    hanging = float(np.sum(crop.fruits))
    if np.isfinite(load) and load > 0.0 and hanging > 0.0:
        share = float(np.clip(load / hanging, 1.0 / LARGEST_LOAD, LARGEST_LOAD))
        crop = crop._replace(fruits=crop.fruits * share, fruit=crop.fruit * share)
    return crop


def first_crop(plant: GreenhouseParameters, mature: bool) -> Crop:
    """Return the crop with which a season begins: in full production, or just planted."""
    return tomato.mature_crop(plant, 1.0) if mature else tomato.young_crop(plant, 1.0)
