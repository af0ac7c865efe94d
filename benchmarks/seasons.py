"""Whole seasons: strategies tuned on a bundle's simulator, led through greenhouses that it does not know.

    python -m benchmarks.seasons tune  --out strategies.json [--generations 40]
    python -m benchmarks.seasons judge --strategies strategies.json [--houses 20] [--days 150]
    python -m benchmarks.seasons rank  [--count 200]

`tune` searches, with the same number of simulated seasons each, a rule for the whole season (one date, and a day from
which on the lamps stay off) and a strategy of six dates, by the elitist genetic algorithm and by CMA-ES (Hansen 2016,
arXiv:1604.00772), at today's and at doubled prices of energy. `judge` leads mechanistic greenhouses, each with other
parameters, weather and undeclared effects, and counts fruit that was ripe and harvested, less costs. All, the recipe
too, keep the crop's limits. `rank` asks whether the simulator puts strategies in the order that a greenhouse does.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.planner import SITE, recipe_table
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.economics import harvest_income, local_days, running_costs
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, tomato
from igrow.core.greenhouse.described import parameters_of
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.planner import EvolutionSettings, NumpyGeneration
from igrow.core.planner.evolution import draw
from igrow.core.planner.plant_simulator import run
from igrow.core.planner.season import Season, Strategy, run_season
from igrow.core.planner.season.course import RADIATION, asked
from igrow.core.planner.template import for_site
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site, load_site
from igrow.core.sun import unix_seconds
from igrow.trainer.research.policies.environment import hourly_weather

Values = NDArray[np.float64]
Genes = NDArray[np.float32]

START = np.datetime64("2020-01-01T23:00:00")
"""Local midnight of the first day."""
DAY = np.timedelta64(86_400, "s")
TYPICAL = 10
"""Days for which a typical one stands while strategies are tuned."""
TUNING_SEEDS, JUDGING_SEED = (9_001, 9_002, 9_003), 700
SETTINGS = EvolutionSettings(parents=24, offspring=48)
EFFECTS = ("wind_infiltration", "screen_gap", "lamp_heat", "co2_valve_leak", "sky_cooling", "photosynthesis_decline")
PARTS = ("electricity", "heat", "co2", "upkeep")


def described(doubled: bool, days: int) -> Site:
    """Return the annotated site with a season of `days`, at today's or doubled prices of energy."""
    site = load_site(SITE)
    end = (START + (days - 1) * DAY).astype("datetime64[D]").astype(object)
    site = replace(site, crop=replace(site.crop, end_date=end))
    if not doubled:
        return site
    tariff = site.prices.electricity
    twice = replace(tariff, peak=2 * tariff.peak, off_peak=2 * tariff.off_peak)
    return replace(site, prices=replace(site.prices, heat=2 * site.prices.heat, electricity=twice))


def typical_days(days: int) -> Values:
    """Return for each stretch of `TYPICAL` days the one of some years that is nearest to their mean, (T, 24, 6)."""
    years = [generate_weather(START, START + days * DAY, seed=seed) for seed in TUNING_SEEDS]
    hours = np.stack([hourly_weather(year, START, 24 * days) for year in years]).reshape(len(years), days, 24, 6)
    chosen = []
    for first in range(0, days, TYPICAL):
        some = hours[:, first : first + TYPICAL].reshape(-1, 24, 6)
        means = some.mean(axis=1)
        away = ((means - means.mean(axis=0)) / np.maximum(means.std(axis=0), 1e-9))[:, [0, 3, 4]]
        chosen.append(some[int(np.argmin((away**2).sum(axis=1)))])
    return np.stack(chosen)


def season_of(site: Site, days: int) -> Season:
    """Return the season to be tuned on: the default bundle's simulator, typical weather."""
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), site.greenhouse, members=1)
    recipe = recipe_table(site, START, 24)
    return Season(site, simulator, parameters_of(site), START, days, typical_days(days), recipe)


def genetic(
    value: Callable[[Genes], Values], genes: int, generations: int, seed: int, first: Genes | None = None
) -> tuple[Genes, list[float]]:
    """Return the best genes by the elitist genetic algorithm, and the best value after each generation."""
    rng, step = np.random.default_rng(seed), NumpyGeneration(SETTINGS)
    offspring: Genes = rng.random((SETTINGS.offspring, genes), dtype=np.float32)
    if first is not None:
        near = first + 0.1 * rng.standard_normal((SETTINGS.offspring // 2, genes))
        offspring[: len(near)] = np.clip(near, 0.0, 1.0)
        offspring[0] = first
    parents, fitness = offspring[: SETTINGS.parents], np.full(SETTINGS.parents, -3e38, dtype=np.float32)
    history = []
    for _ in range(generations):
        found = value(offspring).astype(np.float32)
        parents, fitness, offspring = step(parents, fitness, offspring, found, draw(rng, SETTINGS, genes))
        history.append(float(fitness[0]))
    return parents[0], history


def cma_es(
    value: Callable[[Genes], Values], genes: int, generations: int, seed: int, first: Genes | None = None
) -> tuple[Genes, list[float]]:
    """Return the best genes by CMA-ES with as many candidates."""
    import cma  # noqa: PLC0415 - wanted by this table alone

    options = {"bounds": [0.0, 1.0], "popsize": SETTINGS.offspring, "seed": seed + 1, "verbose": -9}
    start = np.full(genes, 0.5, dtype=np.float32) if first is None else first
    search = cma.CMAEvolutionStrategy(start, 0.25 if first is None else 0.1, options)
    best, best_value = start, -np.inf
    history = []
    for _ in range(generations):
        candidates = search.ask()
        found = value(np.array(candidates, dtype=np.float32))
        search.tell(candidates, (-found).tolist())
        if found.max() > best_value:
            best, best_value = np.array(candidates[int(found.argmax())], dtype=np.float32), float(found.max())
        history.append(float(best_value))
    return best, history


def worth(season: Season, strategy: Strategy) -> Callable[[Genes], Values]:
    """Return what candidates of a strategy are worth in a season from a mature crop on, EUR m-2, (B,)."""
    crop = tomato.mature_crop(season.plant, 1.0)

    def value(genes: Genes) -> Values:
        outcome = run_season(season, strategy, genes, crop)
        return np.asarray(outcome.balance.net_profit - outcome.penalty)

    return value


def tune(arguments: argparse.Namespace) -> None:
    """Search all and write them down."""
    days, generations = arguments.days, arguments.generations
    rule, strategy = Strategy(days, 1, ends=True), Strategy(days, 6)
    result: dict[str, Any] = {"days": days, "strategies": {"today": {}, "doubled": {}}}
    print(f"{'prices':10s}{'search':10s}{'strategy':10s}{'EUR m-2':>9s}{'half way':>9s}{'seconds':>9s}")
    for label, search in (("genetic", genetic), ("CMA-ES", cma_es)):
        for prices, best in result["strategies"].items():
            season = season_of(described(prices == "doubled", days), days)
            began = time.monotonic()
            third = generations // 3
            rest = generations - third
            short, _ = search(worth(season, rule), rule.genes, third, 1)
            found: dict[str, Any] = {
                # A strategy grows out of a rule; both have as many simulated seasons in all.
                "season": search(worth(season, strategy), strategy.genes, rest, 1, strategy.of_rule(rule, short)),
                "rule": search(worth(season, rule), rule.genes, rest, 2, short),
            }
            seconds = time.monotonic() - began
            for name, (genes, history) in found.items():
                half, last = history[len(history) // 2], history[-1]
                print(f"{prices:10s}{label:10s}{name:10s}{last:9.2f}{half:9.2f}{seconds:9.0f}", flush=True)
                one = {"season": strategy, "rule": rule}[name]
                entry = {"genes": genes.tolist(), "value": last, "knots": one.knots, "ends": one.ends}
                if name not in best or last > best[name]["value"]:
                    best[name] = entry
            arguments.out.write_text(json.dumps(result))
    for prices, best in result["strategies"].items():
        print(f"\n{prices}, season:")
        print("\n".join(strategy.table(np.array(best["season"]["genes"], dtype=np.float32), 30)))


@dataclass
class Houses:
    """Greenhouses that no simulator was fitted to, each under weather and with effects of its own, in copies."""

    site: Site
    days: int
    count: int
    copies: int

    def __post_init__(self) -> None:
        rng = np.random.default_rng(JUDGING_SEED)
        end = START + (self.days + 1) * DAY
        weather = [generate_weather(START - 3 * DAY, end, seed=int(rng.integers(2**31))) for _ in range(self.count)]
        varied = [GreenhouseParameters().varied(rng, relative=0.08) for _ in range(self.count)]
        effects = [[HiddenEffect(str(name)) for name in rng.choice(EFFECTS, 2, replace=False)] for _ in varied]
        hours = 24 * (self.days + 3)
        self.hourly = np.stack([hourly_weather(one, START - 3 * DAY, hours) for one in weather])
        self.plant = Plant(
            stack(varied * self.copies),
            WeatherTable(weather * self.copies),
            float(unix_seconds(START)),
            count=self.count * self.copies,
            effects=effects * self.copies,
            disturbances=QUIET,
            sensors=EXACT,
        )


def lead(
    site: Site, days: int, count: int, ways: dict[str, tuple[Strategy, Genes] | None]
) -> dict[str, dict[str, Values]]:
    """Lead the same houses by each way (None: the recipe); EUR m-2, kg m-2 and so on by way, (count,) each."""
    houses = Houses(site, days, count, len(ways))
    total = count * len(ways)
    books = {
        name: np.zeros(total)
        for name in ("income", *PARTS, "kg", "heat_used", "electricity_used", "co2_used", "growth")
    }
    applied, memory = np.full((total, 4), np.nan), None
    for day in range(days):
        begin = START + day * DAY
        expected = houses.hourly[:, 24 * day : 24 * (day + 3)].reshape(count, 3, 24, 6).mean(axis=1)
        template = for_site(site, begin, 24, radiation=expected[:, :, RADIATION].mean(axis=0))
        recipe = recipe_table(site, begin, 24)
        wanted = np.concatenate([
            np.repeat(recipe[None], count, axis=0) if way is None
            else np.concatenate([asked(way[0], way[1][None], day, template, one, recipe) for one in expected])
            for way in ways.values()
        ])  # fmt: skip
        course = template.follow(wanted, applied, memory)
        applied, memory = course.setpoints[:, -1], course.memory
        outcome = run(houses.plant, course.setpoints)
        hours = begin + np.arange(24) * np.timedelta64(3600, "s")
        heat, electricity, co2 = outcome.heat[0], outcome.electricity[0], outcome.co2[0]
        costs = running_costs(
            site.prices, site.time_zone, hours, heat, electricity, co2, site.crop.stem_density, books["co2_used"]
        )
        picked = outcome.fruit_fresh_weight[0].sum(axis=-1)
        local = local_days(np.array([begin + DAY // 2]), site.time_zone)
        books["income"] += harvest_income(site.prices, local, picked, 0.0 * picked, site.crop.brix)
        for part in PARTS:
            books[part] += getattr(costs, part)
        books["kg"] += picked
        for name, amount in (("heat_used", heat), ("electricity_used", electricity), ("co2_used", co2)):
            books[name] += amount.sum(axis=-1)
        books["growth"] += outcome.net_growth[0].sum(axis=-1)
        print(f"\r{day + 1} of {days} days", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    books["net"] = books["income"] - sum(books[part] for part in PARTS)
    return {
        name: {key: values[place * count : (place + 1) * count] for key, values in books.items()}
        for place, name in enumerate(ways)
    }


def judge(arguments: argparse.Namespace) -> None:
    """Print what each way brings in the greenhouses, beside what was expected."""
    given = json.loads(arguments.strategies.read_text())
    days = arguments.days or given["days"]
    result: dict[str, Any] = {}
    for prices in arguments.prices:
        site = described(prices == "doubled", days)
        ways: dict[str, tuple[Strategy, Genes] | None] = {"recipe": None}
        for name, entry in given["strategies"][prices].items():
            strategy = Strategy(given["days"], entry["knots"], entry["ends"])
            ways[name] = (strategy, np.array(entry["genes"], dtype=np.float32))
        found = lead(site, days, arguments.houses, ways)
        result[prices] = {name: {key: values.tolist() for key, values in book.items()} for name, book in found.items()}
        print(f"\n{prices}: {days} days, {arguments.houses} houses, EUR m-2 (mean), over the recipe: median, worst")
        heads = ("kg", "income", *PARTS, "net", "gain %", "lower 95", "worst %")
        print(f"{'':10s}" + "".join(f"{head:>12s}" for head in heads))
        for name, book in found.items():
            gain = 100.0 * (book["net"] / found["recipe"]["net"] - 1.0)
            paired = book["net"] - found["recipe"]["net"]
            lower = paired.mean() - 2.09 * paired.std(ddof=1) / np.sqrt(len(paired)) if name != "recipe" else 0.0
            cells = [*(book[head].mean() for head in heads[:-3]), np.median(gain), lower, gain.min()]
            print(f"{name:10s}" + "".join(f"{cell:12.2f}" for cell in cells), flush=True)
        if "season" in found:
            over = 100.0 * (found["season"]["net"] / found["rule"]["net"] - 1.0)
            print(f"season over rule: median {np.median(over):+.1f} %, worst {over.min():+.1f} %")
        expectations(site, days, ways, found)
    if arguments.json:
        arguments.json.write_text(json.dumps(result))


def expectations(site: Site, days: int, ways: dict[str, Any], found: dict[str, dict[str, Values]]) -> None:
    """Print what the season's simulator expected of each strategy beside the median of what was obtained."""
    season = season_of(site, days)
    crop = tomato.mature_crop(season.plant, 1.0)
    print(
        f"{'expected over obtained':24s}"
        + "".join(f"{name:>12s}" for name in ("net", "kg", "growth", "heat", "electr.", "CO2"))
    )
    for name, way in ways.items():
        if way is None:
            continue
        outcome = run_season(season, way[0], way[1][None], crop)
        book = found[name]
        pairs = (
            (outcome.balance.net_profit, "net"), (outcome.harvest, "kg"), (outcome.used["net_growth"], "growth"),
            (outcome.used["heat"], "heat_used"), (outcome.used["electricity"], "electricity_used"),
            (outcome.used["co2"], "co2_used"),
        )  # fmt: skip
        print(f"{name:24s}" + "".join(f"{float(value[0]) / np.median(book[key]):12.2f}" for value, key in pairs))


def rank(arguments: argparse.Namespace) -> None:
    """Print Spearman's correlation of net profit over random strategies, expected against one greenhouse's."""
    days = arguments.days or 150
    site = described(False, days)
    season = season_of(site, days)
    strategy = Strategy(days, 6)
    genes = np.random.default_rng(5).random((arguments.count, strategy.genes), dtype=np.float32)
    expected = run_season(season, strategy, genes, tomato.mature_crop(season.plant, 1.0)).balance.net_profit
    found = lead(site, days, 1, {str(row): (strategy, genes[row]) for row in range(arguments.count)})
    obtained = np.array([float(found[str(row)]["net"][0]) for row in range(arguments.count)])

    def ranks(values: Values) -> Values:
        return np.argsort(np.argsort(values)).astype(np.float64)

    spearman = np.corrcoef(ranks(expected), ranks(obtained))[0, 1]
    print(f"Spearman over {arguments.count} strategies of {days} days: {spearman:.3f}")


def main() -> int:
    """Run a part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for name, function in (("tune", tune), ("judge", judge), ("rank", rank)):
        command = commands.add_parser(name)
        command.set_defaults(function=function)
        command.add_argument("--days", type=int, default=150 if name == "tune" else None)
        if name == "tune":
            command.add_argument("--out", type=Path, required=True)
            command.add_argument("--generations", type=int, default=40)
        if name == "judge":
            command.add_argument("--strategies", type=Path, required=True)
            command.add_argument("--houses", type=int, default=20)
            command.add_argument("--prices", nargs="+", default=["today", "doubled"])
            command.add_argument("--json", type=Path)
        if name == "rank":
            command.add_argument("--count", type=int, default=200)
    arguments = parser.parse_args()
    arguments.function(arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
