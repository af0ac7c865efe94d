"""The season of a site: the strategy that earns most in its simulator, and what its crop is then worth, date by date.

    plan = plan_season(site, read_bundle("out/bundle"))
    bundle = export(replace(read_model(bundle, site), season=plan), "out/with-season")

Every ten days are lived as two typical days, a cold and a mild one, of the years that a log holds; where it holds none,
of a weather generator for the site's latitude.
"""

from __future__ import annotations

import datetime
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.bundle import Bundle
from igrow.core.errors import IgrowError
from igrow.core.greenhouse import generate_weather, recipe_by_hour
from igrow.core.greenhouse.described import parameters_of
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.planner.evolution import Genes
from igrow.core.planner.season import OPTIONAL, Season, SeasonPlan, Strategy, valued
from igrow.core.planner.season.course import DAY, STRETCH, typical_days
from igrow.core.planner.season.plan import first_crop
from igrow.core.planner.season.search import GENERATIONS, genetic, worth_of
from igrow.core.planner.template import chosen_setpoints
from igrow.core.quantities import WEATHER
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.progress import Progress, silent

KNOTS = 6
"""Dates at which the strategy says its numbers."""
YEARS = 20
"""Generated years, where no log holds any; three were 0.6 K warmer than twenty others."""
LEAST_DAYS = 3
"""Whole days of a log within a stretch's dates that a typical one is chosen of."""
SHORTEST = 30
"""Days of a season below which there is none to be planned."""
BEARING = 60
"""Days after planting from which a crop is taken as in full production."""
NAMES = WEATHER[:6]


def plan_season(
    site: Site,
    bundle: Bundle,
    *,
    begins: datetime.date | None = None,
    weather: Telemetry | None = None,
    generations: int = GENERATIONS,
    partial: Path | None = None,
    progress: Progress = silent,
) -> SeasonPlan:
    """Return the season of a site's crop by a bundle's simulator.

    Args:
        site: with planting and end date, prices and limits.
        bundle: whose simulator it is.
        begins: first local day; the planting date by default.
        weather: of one year or more at the place.
        generations: of the search, in all.
        partial: file in which a search that was cut short goes on.
        progress: is told what is being done, in lines.

    Raises:
        IgrowError: the crop has no end date, or too few days until then.
    """
    season = season_of(site, bundle, begins or site.crop.planting_date, weather, progress)
    age = (begins or site.crop.planting_date) - site.crop.planting_date
    crop = first_crop(season.plant, age.days >= BEARING)
    optional = tuple(name for name in chosen_setpoints(site, season.simulator.setpoints) if name in OPTIONAL)
    rule, strategy = (
        Strategy(season.days, 1, ends=True, optional=optional),
        Strategy(season.days, KNOTS, optional=optional),
    )
    # The strategy grows out of a rule, which takes a third of the search.
    third = generations // 3
    found = _Partial(partial, " ".join([f"{season.start} {season.days} {generations}", *optional]))
    short = found.get("rule", lambda: genetic(worth_of(season, rule, crop), rule.genes, third, 1)[0])
    progress(f"the best rule for the {season.days} days is found")
    first = strategy.of_rule(rule, short)
    value = worth_of(season, strategy, crop)
    genes = found.get("season", lambda: genetic(value, strategy.genes, generations - third, 1, first)[0])
    progress("the best strategy is found; its marginal values follow")
    plan = valued(season, strategy, genes, crop)
    found.clear()
    return plan


def first_day(site: Site, today: datetime.date) -> datetime.date:
    """Return the day from which on a season is planned: today for a crop that bears, else the day of its planting.

    A young crop is only known on the day of its planting.
    """
    planted = site.crop.planting_date
    return today if (today - planted).days >= BEARING else planted


class _Partial:
    """Genes that were found already, in a file."""

    def __init__(self, path: Path | None, what: str) -> None:
        self._path = path
        self._known: dict[str, Any] = {"what": what}
        if path is not None and path.exists():
            try:
                given = json.loads(path.read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise IgrowError(f"{path}: is no search that could go on: {error}; remove it") from None
            self._known = given if isinstance(given, dict) and given.get("what") == what else self._known

    def get(self, name: str, search: Callable[[], Genes]) -> Genes:
        if name not in self._known:
            self._known[name] = [float(gene) for gene in search()]
            if self._path is not None:
                self._path.write_text(json.dumps(self._known), encoding="utf-8")
        return np.array(self._known[name], dtype=np.float32)

    def clear(self) -> None:
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def season_of(
    site: Site, bundle: Bundle, begins: datetime.date, weather: Telemetry | None, progress: Progress
) -> Season:
    """Return the season to be planned; arguments and errors as `plan_season`'s."""
    if site.crop.end_date is None:
        raise IgrowError(f"{site.name}: crop.end_date is not set: a season that has no end cannot be planned")
    days = (site.crop.end_date - begins).days + 1
    if days < SHORTEST:
        raise IgrowError(f"{site.name}: {days} days from {begins} to crop.end_date: {SHORTEST} are needed for a season")
    midnight = datetime.datetime.combine(begins, datetime.time(), ZoneInfo(site.time_zone))
    start = np.datetime64(midnight.astimezone(datetime.UTC).replace(tzinfo=None), "s")
    simulator = BundleSimulator(bundle, site.greenhouse, members=1)
    typical = _typical(site, start, days, weather, progress)
    recipe = recipe_by_hour(start, 24, site.longitude)
    return Season(site, simulator, parameters_of(site), start, days, typical, STRETCH // 2, recipe)


def _typical(site: Site, start: np.datetime64, days: int, log: Telemetry | None, progress: Progress) -> Floats:
    """Return the typical days of all stretches, (2 S, 24, 6)."""
    stretches = range(0, days, STRETCH)
    climate = WeatherClimate(latitude=site.latitude, longitude=site.longitude)
    measured = None if log is None else _days(log, start)
    chosen, made = [], 0
    for first in stretches:
        begin = start + first * DAY
        some = np.empty((0, 24, 6)) if measured is None else _of_dates(*measured, begin)
        if len(some) < LEAST_DAYS:
            made += 1
            years = [
                generate_weather(begin, begin + STRETCH * DAY, seed=seed, climate=climate) for seed in range(YEARS)
            ]
            some = np.concatenate([_days(year, begin)[1] for year in years])
        chosen.append(typical_days(some))
    if made:
        progress(f"{made} of {len(stretches)} stretches have a generator's weather: none of those dates was given")
    return np.concatenate(chosen)


def _days(log: Telemetry, start: np.datetime64) -> tuple[Times, Floats]:
    """Return the beginnings of the whole days of a log, as `start` is one, and their weather, (D, 24, 6)."""
    table = to_grid(log, 3600)
    offset = int((start - table.time[0]) / np.timedelta64(3600, "s")) % 24
    count = (len(table) - offset) // 24
    lacking = [name for name in NAMES if name not in table]
    if lacking:
        raise IgrowError(f"the weather lacks {', '.join(lacking)}")
    rows = slice(offset, offset + 24 * count)
    days = np.stack([table[name][rows] for name in NAMES], axis=1).reshape(count, 24, len(NAMES))
    whole = np.isfinite(days).all(axis=(1, 2))
    return table.time[rows][::24][whole], days[whole]


def _of_dates(begins: Times, days: Floats, first: np.datetime64) -> Floats:
    """Return the days of any year whose dates lie in the stretch that begins at `first`."""
    after = (begins - first) / np.timedelta64(1, "D") % 365.25
    return days[after < STRETCH]
