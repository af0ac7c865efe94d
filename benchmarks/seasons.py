"""Whole seasons: strategies tuned on a bundle's simulator, led through greenhouses that it does not know.

    python -m benchmarks.seasons tune  [--generations 36] [--search genetic CMA-ES]
    python -m benchmarks.seasons expect
    python -m benchmarks.seasons judge [--greenhouses 20]
    python -m benchmarks.seasons rank  [--drawn 200]

`tune` searches, with the same number of simulated seasons each, a rule for the whole season (one date, and a day
from which on the lamps stay off) and a strategy of six dates, at today's and at doubled prices of energy, and
writes them to `benchmarks/season_strategies.json`. `expect` prints what the simulator expects of them. `judge`
leads mechanistic greenhouses by them, each with other parameters (8 %), weather and two undeclared effects, through
the PLC's own control, and counts fruit that was ripe and picked, less costs; then it compares what was expected, by
the bundle alone and corrected by what each greenhouse used in the weeks before. `rank` asks whether the simulator puts
random strategies in the order that one greenhouse does. All, the recipe too, keep the crop's limits, six dark hours
among them. Greenhouses and weather are not those of the tuning.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr
from scipy.stats import t as student

from benchmarks.led_greenhouses import SITE
from benchmarks.season_greenhouses import DAY, PARTS, START, Led, Past, Recipe, Way, lead, money
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse import generate_weather, hourly_weather, recipe_by_hour, tomato
from igrow.core.greenhouse.described import parameters_of
from igrow.core.planner.evolution import Genes
from igrow.core.planner.recent_use import Corrected
from igrow.core.planner.season import Season, Strategy, run_season
from igrow.core.planner.season.course import STRETCH, typical_days
from igrow.core.planner.season.search import GENERATIONS, SETTINGS, Search, genetic, rule_and_strategy
from igrow.core.simulator.outcome import Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site, load_site

STRATEGIES = Path(__file__).with_name("season_strategies.json")
TUNING_SEEDS = tuple(range(9_001, 9_021))
RANKED_SEED, RANKED_HOUSE = 5, 20
PRICES = ("today", "doubled")
GROWN_AND_USED = ("net_growth", "heat", "electricity", "co2")


def described(prices: str, days: int) -> Site:
    """Return the annotated site with a season of `days`, at today's or doubled prices of energy."""
    site = load_site(SITE)
    end = (START + (days - 1) * DAY).astype("datetime64[D]").astype(object)
    site = replace(site, crop=replace(site.crop, end_date=end))
    if prices == "today":
        return site
    tariff = site.prices.electricity
    twice = replace(tariff, peak=2 * tariff.peak, off_peak=2 * tariff.off_peak)
    return replace(site, prices=replace(site.prices, heat=2 * site.prices.heat, electricity=twice))


def typical_weather(days: int) -> Floats:
    """Return the two typical days of each stretch of some years, (2 S, 24, 6)."""
    years = [generate_weather(START, START + days * DAY, seed=seed) for seed in TUNING_SEEDS]
    hours = np.stack([hourly_weather(year, START, 24 * days) for year in years]).reshape(len(years), days, 24, 6)
    stretches = [hours[:, first : first + STRETCH].reshape(-1, 24, 6) for first in range(0, days, STRETCH)]
    return np.concatenate([typical_days(one) for one in stretches])


def season_of(site: Site, days: int) -> Season:
    """Return the season to be tuned on: the default bundle's simulator, typical weather."""
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), site.greenhouse, members=1)
    recipe = recipe_by_hour(START, 24, site.longitude)
    return Season(site, simulator, parameters_of(site), START, days, typical_weather(days), STRETCH // 2, recipe)


def cma_es(
    value: Callable[[Genes], Floats], genes: int, generations: int, seed: int, first: Genes | None = None
) -> tuple[Genes, list[float]]:
    """Return the best genes by CMA-ES (Hansen 2016, arXiv:1604.00772) with as many candidates."""
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


SEARCHES: dict[str, Search] = {"genetic": genetic, "CMA-ES": cma_es}


def ways_of(days: int) -> dict[str, Strategy]:
    """Return the two that are tuned."""
    return {"rule": Strategy(days, 1, ends=True), "season": Strategy(days, 6)}


def tune(arguments: argparse.Namespace) -> None:
    """Search all and write the best down."""
    days, kinds = arguments.days, ways_of(arguments.days)
    result: dict[str, Any] = {"days": days, "strategies": {prices: {} for prices in PRICES}}
    print(f"{'prices':10s}{'search':10s}{'strategy':10s}{'EUR m-2':>9s}{'half way':>9s}{'seconds':>9s}")
    for label in arguments.search:
        for prices, best in result["strategies"].items():
            season, began = season_of(described(prices, days), days), time.process_time()
            crop = tomato.mature_crop(season.plant, 1.0)
            search = SEARCHES[label]
            found = rule_and_strategy(season, kinds["rule"], kinds["season"], crop, arguments.generations, search)
            seconds = time.process_time() - began
            for name, (genes, history) in found.items():
                half, last = history[len(history) // 2], history[-1]
                print(f"{prices:10s}{label:10s}{name:10s}{last:9.2f}{half:9.2f}{seconds:9.0f}", flush=True)
                if name not in best or last > best[name]["value"]:
                    best[name] = {"genes": [round(float(gene), 5) for gene in genes], "value": last}
            arguments.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    for prices, best in result["strategies"].items():
        print(f"\n{prices}, season:")
        print("\n".join(kinds["season"].table(np.array(best["season"]["genes"], dtype=np.float32), 30)))


def expect(arguments: argparse.Namespace) -> None:
    """Print what the season's simulator expects of the strategies that were written down."""
    given = json.loads(arguments.strategies.read_text(encoding="utf-8"))
    days, kinds = given["days"], ways_of(given["days"])
    print(f"{'prices':10s}{'strategy':10s}" + "".join(f"{head:>12s}" for head in ("net", "kg", *GROWN_AND_USED)))
    for prices in PRICES:
        season = season_of(described(prices, days), days)
        for name, entry in given["strategies"][prices].items():
            genes = np.array([entry["genes"]], dtype=np.float32)
            one = run_season(season, kinds[name], genes, tomato.mature_crop(season.plant, 1.0))
            parts = (one.balance.net_profit, one.harvest, *(one.used[key] for key in GROWN_AND_USED))
            print(f"{prices:10s}{name:10s}" + "".join(f"{float(part[0]):12.2f}" for part in parts))


def judge(arguments: argparse.Namespace) -> None:
    """Lead all greenhouses by all ways at once, and print the tables."""
    given = json.loads(arguments.strategies.read_text(encoding="utf-8"))
    days, kinds = given["days"], ways_of(given["days"])
    ways: dict[str, Way] = {"recipe": Recipe()}
    for prices in PRICES:
        for name, entry in given["strategies"][prices].items():
            ways[f"{name} {prices}"] = Led(kinds[name], np.array([entry["genes"]], dtype=np.float32))
    books, past = lead(
        described("today", days), days, ways, {name: list(range(arguments.greenhouses)) for name in ways}
    )
    if arguments.json:
        arguments.json.write_text(
            json.dumps({name: {key: one.tolist() for key, one in book.items()} for name, book in books.items()})
        )
    for prices in PRICES:
        site = described(prices, days)
        led = {"recipe": "recipe"} | {name: f"{name} {prices}" for name in kinds}
        brought(
            f"energy at {prices} prices", {name: (money(site, books[key]), books[key]) for name, key in led.items()}
        )
        expected_and_obtained(site, days, {name: ways[key] for name, key in led.items()}, books, led, past)


def brought(title: str, found: dict[str, tuple[dict[str, Floats], dict[str, Floats]]]) -> None:
    """Print what each way brought, by its money and its book, and what more than each that stands above it."""
    count = len(next(iter(found.values()))[0]["net"])
    print(f"\n{title}: {count} greenhouses, EUR m-2 of a season (mean)")
    heads = ("income", *PARTS, "net")
    print(f"{'':10s}{'kg':>9s}" + "".join(f"{head:>12s}" for head in heads))
    for name, (one, book) in found.items():
        kg = book["kg"].sum(axis=1).mean()
        print(f"{name:10s}{kg:9.2f}" + "".join(f"{one[head].mean():12.2f}" for head in heads))
    print(f"{'net of':10s}{'over':>12s}{'median %':>12s}{'worst %':>12s}{'mean EUR':>12s}{'lower 95':>12s}")
    for (other, (less, _)), (name, (one, _)) in combinations(found.items(), 2):
        more = one["net"] - less["net"]
        share = 100.0 * more / np.abs(less["net"])
        error = float(student.ppf(0.975, count - 1)) * more.std(ddof=1) / np.sqrt(count) if count > 1 else np.nan
        cells = (np.median(share), share.min(), more.mean(), more.mean() - error)
        print(f"{name:10s}{other:>12s}" + "".join(f"{cell:12.2f}" for cell in cells))


def expected_and_obtained(
    site: Site, days: int, ways: dict[str, Way], books: Any, led: dict[str, str], past: Past
) -> None:
    """Print the median greenhouse's ratio of what was expected to what was obtained, by strategy.

    As the season's simulator has it, and corrected by what each greenhouse used under the recipe before the season.
    """
    season = season_of(site, days)
    crop = tomato.mature_crop(season.plant, 1.0)
    heads = ("net", "kg", "growth", "heat", "electricity", "CO2")
    print(f"{'expected / obtained':22s}" + "".join(f"{name:>12s}" for name in heads))
    for name, way in ways.items():
        if not isinstance(way, Led):
            continue
        book = books[led[name]]
        count = len(book["kg"])
        had = [money(site, book)["net"], *(book[key].sum(axis=1) for key in ("kg", *GROWN_AND_USED))]

        def said(simulator: Simulator, way: Led = way) -> list[float]:
            outcome = run_season(replace(season, simulator=simulator), way.strategy, way.genes, crop)
            parts = (outcome.balance.net_profit, outcome.harvest, *(outcome.used[key] for key in GROWN_AND_USED))
            return [float(one[0]) for one in parts]

        corrected = [said(Corrected(season.simulator, past.factor(season.simulator, row))) for row in range(count)]
        for label, expected in ((name, [said(season.simulator)] * count), (f"{name}, corrected", corrected)):
            ratios = np.median(np.array(expected) / np.stack(had, axis=1), axis=0)
            print(f"{label:22s}" + "".join(f"{ratio:12.2f}" for ratio in ratios))


def rank(arguments: argparse.Namespace) -> None:
    """Print Spearman's correlation of net profit over random strategies, expected against one greenhouse's."""
    days, count = arguments.days, arguments.drawn
    site, strategy = described("today", days), ways_of(days)["season"]
    genes = np.random.default_rng(RANKED_SEED).random((count, strategy.genes), dtype=np.float32)
    books, _ = lead(site, days, {"random": Led(strategy, genes)}, {"random": [RANKED_HOUSE] * count})
    season = season_of(site, days)
    expected = run_season(season, strategy, genes, tomato.mature_crop(season.plant, 1.0)).balance.net_profit
    found = spearmanr(expected, money(site, books["random"])["net"]).statistic
    print(f"Spearman of net profit over {count} random strategies, expected against one greenhouse: {found:.3f}")


def main() -> int:
    """Run a part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    tuning = commands.add_parser("tune")
    tuning.set_defaults(function=tune)
    tuning.add_argument("--days", type=int, default=150)
    tuning.add_argument("--out", type=Path, default=STRATEGIES)
    tuning.add_argument("--generations", type=int, default=GENERATIONS)
    tuning.add_argument("--search", nargs="+", choices=SEARCHES, default=list(SEARCHES))
    expecting = commands.add_parser("expect")
    expecting.set_defaults(function=expect)
    expecting.add_argument("--strategies", type=Path, default=STRATEGIES)
    judging = commands.add_parser("judge")
    judging.set_defaults(function=judge)
    judging.add_argument("--strategies", type=Path, default=STRATEGIES)
    judging.add_argument("--greenhouses", type=int, default=20)
    judging.add_argument("--json", type=Path, help="file for what each greenhouse used and picked by day")
    ranking = commands.add_parser("rank")
    ranking.set_defaults(function=rank)
    ranking.add_argument("--days", type=int, default=150)
    ranking.add_argument("--drawn", type=int, default=200, help="random strategies")
    arguments = parser.parse_args()
    arguments.function(arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
