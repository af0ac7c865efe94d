"""Greenhouses that no simulator was fitted to, led through whole seasons, all ways and prices in one batch.

The plant's minutes cost as much for hundreds of greenhouses as for twenty, so that every way leads copies of the same
greenhouses at once. A way asks for the setpoints of a day at local midnight; limits of site and crop hold alike for
all.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.led_greenhouses import run
from igrow.core.agronomy import Memory
from igrow.core.arrays import Floats
from igrow.core.economics import co2_cost, harvest_income, is_peak, local_days
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, hourly_weather, recipe_by_hour
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.local_time import hour_of_day
from igrow.core.planner.evolution import Genes
from igrow.core.planner.recent_use import SCALED, factors
from igrow.core.planner.season import Strategy
from igrow.core.planner.season.course import RADIATION, asked
from igrow.core.planner.template import Template, for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator.outcome import Outcome, Simulator
from igrow.core.site import Site
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry

START = np.datetime64("2020-01-01T23:00:00")
"""Local midnight of the first day."""
DAY = np.timedelta64(86_400, "s")
HOUR = np.timedelta64(3600, "s")
BEFORE = 28
"""Days under the recipe before it: soil and a grown crop need them to fit each other."""
JUDGED = 14
"""The last of them, by which a simulator learns what a greenhouse uses."""
FIRST = -BEFORE - 3
"""First day of weather, from which the first day under the recipe can be forecast."""
SEED = 700
EFFECTS = ("wind_infiltration", "screen_gap", "lamp_heat", "co2_valve_leak", "sky_cooling", "photosynthesis_decline")
PARTS = ("electricity", "heat", "co2", "upkeep")
USED = ("heat", "electricity", "co2", "net_growth")


@dataclass(frozen=True)
class Morning:
    """What a way knows at a local midnight of its N greenhouses."""

    day: int
    begin: np.datetime64
    weather: Floats
    """That is expected: the mean of the last three days, (N, 24, 6)."""
    recipe: Floats
    """(24, S)."""
    template: Template
    present: Mapping[str, Floats]
    """As measured, by quantity, (N,)."""
    applied: Floats
    """(N, S)."""
    memory: Memory
    """Of all rows; `rows` are the way's."""
    rows: slice
    co2_before: Floats
    """kg m-2 since the beginning, (N,)."""


class Way(Protocol):
    """Leads greenhouses."""

    def ask(self, morning: Morning) -> Floats:
        """Return the setpoints of a day, (N, 24, S)."""

    def learn(self, morning: Morning, outcome: Outcome, weather: Floats) -> None:
        """Take notice of what the day did, arrays (1, N, 24), under which weather, (N, 24, 6)."""


class Recipe:
    """The grower's day."""

    def ask(self, morning: Morning) -> Floats:
        """Return it for each greenhouse."""
        return np.repeat(morning.recipe[None], len(morning.weather), axis=0)

    def learn(self, morning: Morning, outcome: Outcome, weather: Floats) -> None:
        """Learn nothing."""


@dataclass(frozen=True)
class Led(Recipe):
    """A strategy of the season, one for all greenhouses, or one for each."""

    strategy: Strategy
    genes: Genes
    """(1, G) or (N, G)."""

    def ask(self, morning: Morning) -> Floats:
        """Return what it says under each greenhouse's weather."""
        many = np.broadcast_to(self.genes, (len(morning.weather), self.genes.shape[1]))
        days = [
            asked(self.strategy, many[[row]], morning.day, morning.template, one, morning.recipe)
            for row, one in enumerate(morning.weather)
        ]
        return np.concatenate(days)


class Greenhouses:
    """Greenhouses by number, each with parameters, weather and two undeclared effects of its own; one for each row."""

    def __init__(self, days: int, numbers: Sequence[int]) -> None:
        made = {number: _greenhouse(days, number) for number in sorted(set(numbers))}
        each = [made[number] for number in numbers]
        self.hourly = np.stack([one.hourly for one in each])
        """From `FIRST` on, (rows, days, 24, 6)."""
        self.plant = self.stand(each)

    def stand(self, each: Sequence[Greenhouse]) -> Plant:
        """Return the plant that these greenhouses are."""
        return Plant(
            stack([one.parameters for one in each]),
            WeatherTable([one.weather for one in each]),
            float(unix_seconds(START - BEFORE * DAY)),
            count=len(each),
            effects=[one.effects for one in each],
            disturbances=QUIET,
            sensors=EXACT,
        )

    def advance(self, setpoints: Floats, begin: np.datetime64) -> Outcome:
        """Live from local midnight on under setpoints (rows, 24, S); returns what happened, (1, rows, 24)."""
        return run(self.plant, setpoints)

    def weather(self, day: int) -> Floats:
        """Return the weather of a day counted from the season's first, (rows, 24, 6)."""
        return self.hourly[:, day - FIRST]

    def expected(self, day: int) -> Floats:
        """Return the mean of the three days before it, (rows, 24, 6)."""
        return np.asarray(self.hourly[:, day - FIRST - 3 : day - FIRST].mean(axis=1))

    def measured(self) -> dict[str, Floats]:
        """Return what the greenhouses' sensors show, by quantity, (rows,)."""
        total = self.plant.count or 1
        return {name: np.broadcast_to(value, total) for name, value in self.plant.truth({}).items()}


@dataclass(frozen=True)
class Greenhouse:
    """What one of them is."""

    parameters: GreenhouseParameters
    weather: Telemetry
    hourly: Floats
    effects: Sequence[HiddenEffect]


def _greenhouse(days: int, number: int) -> Greenhouse:
    rng = np.random.default_rng((SEED, number))
    begin, count = START + FIRST * DAY, days - FIRST
    weather = generate_weather(begin, START + (days + 1) * DAY, seed=int(rng.integers(2**31)))
    hourly = hourly_weather(weather, begin, 24 * count).reshape(count, 24, 6)
    varied = GreenhouseParameters().varied(rng, relative=0.08)
    return Greenhouse(
        varied, weather, hourly, [HiddenEffect(str(name)) for name in rng.choice(EFFECTS, 2, replace=False)]
    )


@dataclass(frozen=True)
class Past:
    """What greenhouses did under the recipe before a season; a row for each."""

    start: np.datetime64
    initial: Mapping[str, Floats]
    """As measured at the start, (rows,)."""
    weather: Floats
    """(rows, H, 6)."""
    setpoints: Floats
    """(rows, H, S)."""
    used: Mapping[str, Floats]
    """Heat, electricity and CO2 by day, (rows, days)."""

    def factor(self, simulator: Simulator, row: int) -> dict[str, float]:
        """Return what a greenhouse used over what a simulator says of it, by what is used."""
        initial = {name: float(value[row]) for name, value in self.initial.items()}
        said = simulator.simulate(initial, self.weather[row], self.setpoints[[row]], self.start)
        expected = {name: getattr(said, name)[0, 0].reshape(-1, 24).sum(axis=1) for name in SCALED}
        # The floor's warmth is not measured; a day later it is known.
        return factors(
            {name: one[1:] for name, one in expected.items()}, {name: self.used[name][row, 1:] for name in SCALED}
        )


def lead(
    site: Site,
    days: int,
    ways: Mapping[str, Way],
    greenhouses: Mapping[str, Sequence[int]],
    stood: Callable[[int, Sequence[int]], Greenhouses] = Greenhouses,
) -> tuple[dict[str, dict[str, Floats]], Past]:
    """Lead greenhouses by each way; return what each used and picked by day, and what all did before.

    By way and name, (its greenhouses, days): `heat` MJ m-2, `electricity` kWh m-2 (and `peak` of it), `co2`,
    `net_growth` and `kg` (fresh fruit picked) kg m-2. The past's rows are all greenhouses, way after way; `stood`
    makes them.
    """
    numbers: list[int] = []
    rows: dict[str, slice] = {}
    for name in ways:
        rows[name] = slice(len(numbers), len(numbers) + len(greenhouses[name]))
        numbers += greenhouses[name]
    led = stood(days, numbers)
    past, applied, memory = settle(site, led)
    co2 = np.zeros(len(numbers))
    books: dict[str, list[Floats]] = {name: [] for name in (*USED, "peak", "kg")}
    began = time.monotonic()
    for day in range(days):
        begin = START + day * DAY
        expected = led.expected(day)
        template = for_site(site, begin, 24, radiation=expected[:, :, RADIATION].mean(axis=0))
        recipe, present = recipe_by_hour(begin, 24, site.longitude), led.measured()
        mornings = {
            name: Morning(
                day, begin, expected[part], recipe, template, {key: value[part] for key, value in present.items()},
                applied[part], memory, part, co2[part],
            )
            for name, part in rows.items()
        }  # fmt: skip
        course = template.follow(np.concatenate([ways[name].ask(mornings[name]) for name in ways]), applied, memory)
        applied, memory = course.setpoints[:, -1], course.memory
        outcome = led.advance(course.setpoints, begin)
        for name, part in rows.items():
            mine = Outcome(**{key: value[:, part] for key, value in vars(outcome).items()})
            ways[name].learn(mornings[name], mine, led.weather(day)[part])
        peak = is_peak(site.prices, hour_of_day(begin + np.arange(24) * HOUR, site.time_zone))
        for name in USED:
            books[name].append(getattr(outcome, name)[0].sum(axis=-1))
        books["peak"].append(outcome.electricity[0][:, peak].sum(axis=-1))
        books["kg"].append(outcome.fruit_fresh_weight[0].sum(axis=-1))
        co2 = co2 + books["co2"][-1]
        left = (time.monotonic() - began) / (day + 1) * (days - day - 1)
        print(f"\r{day + 1} of {days} days, {left / 60.0:.0f} min left ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    found = {name: {key: np.stack(one, axis=1)[part] for key, one in books.items()} for name, part in rows.items()}
    return found, past


def settle(site: Site, led: Greenhouses) -> tuple[Past, Floats, Memory]:
    """Lead all by the recipe until the season; return the past, the last setpoints and what crops have had."""
    applied, memory = np.full((len(led.hourly), len(SETPOINTS)), np.nan), None
    initial: dict[str, Floats] = {}
    setpoints, used = [], []
    for day in range(-BEFORE, 0):
        begin = START + day * DAY
        if day == -JUDGED:
            initial = {name: value.copy() for name, value in led.measured().items()}
        radiation = led.expected(day)[:, :, RADIATION].mean(axis=0)
        recipe = np.repeat(recipe_by_hour(begin, 24, site.longitude)[None], len(led.hourly), axis=0)
        course = for_site(site, begin, 24, radiation=radiation).follow(recipe, applied, memory)
        applied, memory = course.setpoints[:, -1], course.memory
        outcome = led.advance(course.setpoints, begin)
        setpoints.append(course.setpoints)
        used.append({name: getattr(outcome, name)[0].sum(axis=-1) for name in SCALED})
    judged = np.concatenate([led.weather(day) for day in range(-JUDGED, 0)], axis=1)
    past = Past(
        START - JUDGED * DAY,
        initial,
        judged,
        np.concatenate(setpoints[-JUDGED:], axis=1),
        {name: np.stack([one[name] for one in used[-JUDGED:]], axis=1) for name in SCALED},
    )
    assert memory is not None
    return past, applied, memory


def money(site: Site, book: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return what a season brought, EUR m-2, (greenhouses,): income of picked fruit, costs by `PARTS`, and net."""
    prices, days = site.prices, book["kg"].shape[1]
    local = local_days(START + np.arange(days) * DAY + DAY // 2, site.time_zone)
    tariff = prices.electricity
    found = {
        "income": harvest_income(prices, local, book["kg"], 0.0 * book["kg"], site.crop.brix).sum(axis=1),
        "electricity": (tariff.off_peak * book["electricity"] + (tariff.peak - tariff.off_peak) * book["peak"]).sum(
            axis=1
        ),
        "heat": prices.heat * book["heat"].sum(axis=1),
        "co2": co2_cost(prices, 0.0, book["co2"].sum(axis=1)),
        "upkeep": np.full(len(book["kg"]), prices.stem_day * site.crop.stem_density * days),
    }
    return found | {"net": found["income"] - sum(found[part] for part in PARTS)}
