"""What a humidity setpoint brings: seasons with and without it, in greenhouses whose climate computer takes one.

    python -m benchmarks.season_humidity [--greenhouses 20] [--generations 36] [--led 150]

The built-in bundle's simulator is given vents that open by the larger of what temperature and humidity ask, fitted to
virtual seasons in which the humidity setpoint was moved each day. On it a rule and a strategy of six dates are tuned,
without the setpoint and with it. Both strategies, the second at the computers' own humidity too, the rule with it, and
rule and strategy that were tuned on the built-in bundle as it is, lead the greenhouses of `benchmarks.seasons judge`
(8 % off, own weather, two undeclared effects) at today's prices beside the recipe, for the first `--led` days. Less
than the whole season says little of fruit that was picked, so growth is told too, at the price that fruit now growing
earns on average. Damp hours are those of the greenhouses.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.led_greenhouses import run
from benchmarks.season_greenhouses import DAY, PARTS, START, Greenhouses, Led, Recipe, Way, lead, money
from benchmarks.seasons import GROWN_AND_USED, STRATEGIES, brought, described, season_of, ways_of
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse import GreenhouseParameters, Season, generate_weather, recipe, simulate_many, tomato
from igrow.core.greenhouse.recipe import COMPUTER
from igrow.core.planner.objective import Objective, damp_hours
from igrow.core.planner.season import Strategy, run_season
from igrow.core.planner.season.search import rule_and_strategy
from igrow.core.quantities import USUAL_SETPOINTS
from igrow.core.simulator.outcome import Outcome
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.trainer.data import prepare_log
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit.actuation import fit_actuation, setpoint_columns
from igrow.trainer.fit.model import FittedModel

MOVED = (74.0, 92.0)
"""% between which the setpoint was moved in the seasons that teach the rules."""
TAKEN = (*USUAL_SETPOINTS, "humidity_setpoint")
HUMIDITY = COMPUTER["humidity_setpoint"]
"""What the computers hold by themselves, %."""
TAUGHT_DAYS = 28
TAUGHT_BEGINS = ("2020-01-10T00:00:00", "2020-03-20T00:00:00")
SEED = 31
PICKED_FROM = 100
"""Days from which on fruit that was picked tells most of what grew under a strategy."""


def taking(site: Site) -> Site:
    """Return the site with a humidity setpoint that plans may choose."""
    planning = replace(site.planning, optimise=(*site.planning.optimise, "humidity_setpoint"))
    return replace(site, setpoints=TAKEN, planning=planning)


def taught_season(begins: str, number: int) -> Season:
    """Return some weeks of a virtual greenhouse under the recipe, its humidity setpoint moved each day."""
    start = np.datetime64(begins)
    end = start + np.timedelta64(TAUGHT_DAYS, "D")
    random = np.random.default_rng((SEED, number))
    moved = random.uniform(*MOVED, TAUGHT_DAYS + 1)

    def schedule(time: np.datetime64) -> dict[str, float]:
        return {**recipe(time), "humidity_setpoint": float(moved[int((time - start) / np.timedelta64(1, "D"))])}

    plant = GreenhouseParameters().varied(random, 0.04)
    weather = generate_weather(start, end, seed=SEED + number)
    (season,) = simulate_many([plant], [weather], schedule, start, end, count=1, seed=number)
    return season


def taught(site: Site) -> FittedModel:
    """Return the built-in bundle's model with vents that answer to the humidity setpoint."""
    model = read_model(read_bundle(default_bundle_folder()), site)
    parts = []
    for number, begins in enumerate(TAUGHT_BEGINS):
        log = prepare_log(taught_season(begins, number).measured, site)
        record = log.record(0.0)
        parts.append((record, setpoint_columns(log.telemetry, record, site)[0], None))
    return replace(model, actuation=fit_actuation(parts, model.posterior.values))


class TakingGreenhouses(Greenhouses):
    """Greenhouses whose computers take a humidity setpoint as well."""

    def __init__(self, site: Site, days: int, numbers: Sequence[int]) -> None:
        super().__init__(days, numbers)
        self._site = site
        self.damp: list[Floats] = []
        """Hours of each day of the season, (rows,)."""

    def advance(self, setpoints: Floats, begin: np.datetime64) -> Outcome:
        """Live a day, and count its damp hours."""
        outcome = run(self.plant, setpoints, TAKEN)
        if begin >= START:
            self.damp.append(damp_hours(outcome, self._site))
        return outcome


def main() -> int:
    """Teach, tune, lead and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greenhouses", type=int, default=20)
    parser.add_argument("--generations", type=int, default=36)
    parser.add_argument("--led", type=int, default=150, help="days of the season that are led")
    arguments = parser.parse_args()
    given = json.loads(STRATEGIES.read_text(encoding="utf-8"))
    days = given["days"]
    site = taking(described("today", days))
    model = taught(site)
    for name in ("humidity", "humidity_opening", "humidity_band"):
        print(f"rule of the lee vents, {name}: {model.actuation[f'lee_{name}']:.3g}")
    with tempfile.TemporaryDirectory() as folder:
        simulator = BundleSimulator(export(model, Path(folder) / "bundle"), site.greenhouse, members=1)
        season = replace(season_of(site, days), simulator=simulator)
        crop = tomato.mature_crop(season.plant, 1.0)
        ways: dict[str, Way] = {"recipe": Recipe()}
        for name, kind in (("rule", "rule"), ("built-in", "season")):
            genes = np.array([given["strategies"]["today"][kind]["genes"]], dtype=np.float32)
            ways[name] = Led(ways_of(days)[kind], genes)
        for name, optional in (("without", ()), ("with", ("humidity_setpoint",))):
            rule, strategy = Strategy(days, 1, ends=True, optional=optional), Strategy(days, 6, optional=optional)
            found = rule_and_strategy(season, rule, strategy, crop, arguments.generations)
            best, _ = found["season"]
            ways[name] = Led(strategy, best[None])
            if optional:
                ways["rule with"] = Led(rule, found["rule"][0][None])
                low, high = strategy.ranges["humidity"]
                held = best.copy()
                held[-strategy.knots :] = (HUMIDITY - low) / (high - low)
                ways[f"at {HUMIDITY:g} %"] = Led(strategy, held[None])
            print(f"{name}:")
            print("\n".join(strategy.table(best, 30)), flush=True)
        for name, way in ways.items():
            if not isinstance(way, Led):
                continue
            net = float(run_season(season, way.strategy, way.genes, crop).balance.net_profit[0])
            print(f"{name:10s}expected net {net:.2f} EUR m-2", flush=True)
    led_through(site, ways, arguments.led, arguments.greenhouses)
    return 0


def led_through(site: Site, ways: Mapping[str, Way], days: int, greenhouses: int) -> None:
    """Lead greenhouses through the first days of a season, and print what came of it."""
    stood: list[TakingGreenhouses] = []

    def stand(length: int, rows: Sequence[int]) -> TakingGreenhouses:
        stood.append(TakingGreenhouses(site, length, rows))
        return stood[-1]

    books, _ = lead(site, days, ways, {name: list(range(greenhouses)) for name in ways}, stand)
    spent = {name: money(site, book) for name, book in books.items()}
    if days > PICKED_FROM:
        brought(f"energy at today's prices, {days} days", {name: (spent[name], books[name]) for name in ways})
    price = float(Objective(site, START + np.arange(days) * DAY).growth_price().mean())
    fresh = site.crop.fruit_share / site.crop.dry_matter_fraction
    heads = ("growth", "heat", "electricity", "CO2", "EUR m-2", "over first", "worst", "damp h/day", "damp days %")
    print(f"{f'{days} days':10s}" + "".join(f"{head:>12s}" for head in heads))
    damp = dict(zip(ways, np.stack(stood[0].damp, axis=1).reshape(len(ways), greenhouses, days), strict=True))
    margin = {}
    for name, book in books.items():
        used = {key: book[key].sum(axis=1) for key in GROWN_AND_USED}
        margin[name] = used["net_growth"] * fresh * price - sum(spent[name][part] for part in PARTS)
        more = margin[name] - next(iter(margin.values()))
        wet = damp[name] > site.crop.agronomy.damp_hours
        cells = (*(one.mean() for one in used.values()), margin[name].mean(), more.mean(), more.min())
        cells = (*cells, damp[name].mean(), 100.0 * wet.mean())
        print(f"{name:10s}" + "".join(f"{cell:12.3f}" for cell in cells))


if __name__ == "__main__":
    sys.exit(main())
