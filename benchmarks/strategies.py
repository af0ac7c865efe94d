"""Which strategy earns most: weeks in mechanistic greenhouses, led by what a bundle's simulator advises.

    python -m benchmarks.strategies [--bundle FOLDER] [--policy NAME=policy.onnx ...] [--days 14] [--greenhouses 4]

Every strategy leads the same greenhouses (each differs from the described one, as one from the next) under the same
weather, in winter and in spring. None of them has seen greenhouse or weather; all of them plan with the bundle's
simulator, which is not the greenhouse. "One day alone" is the genetic algorithm that does not look at the day after the
one that it chooses. For each the table tells what the simulator expected of the coming hours
whenever setpoints were chosen, and what the greenhouse then obtained, by the same rules of value
(`igrow.core.planner.objective`). The spread is over greenhouses and seasons, of the gain over the recipe.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.led_greenhouses import DAY, SITE, Greenhouses, Scenario
from benchmarks.onnx_policy import OnnxPolicy
from igrow.core.agronomy import Memory
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.economics import harvest_income, local_days
from igrow.core.greenhouse import hourly_weather, recipe_by_hour
from igrow.core.planner import Objective, PlanningState, optimise
from igrow.core.planner.recent_use import (
    SCALED,
    Corrected,
    factors,
    grown_days,
    growth_of_days,
    totals,
    warmer,
)
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator.outcome import Outcome, Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site, load_site
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry
from igrow.edge.planning.forecast import persistence
from igrow.edge.planning.make_plan import RECENT_DAYS
from igrow.trainer.research.policies.policy import HOURS as POLICY_HOURS
from igrow.trainer.research.policies.policy import PAPER_COLUMNS

STARTS = ("2020-01-19T23:00:00", "2020-03-09T23:00:00", "2020-04-19T22:00:00")
"""Local midnights at which the weeks begin: winter, early spring, spring."""
SETTLING = 6
"""Days under the recipe before them."""
HORIZON = 48
"""Hours that a strategy looks ahead: the day that it chooses, and one beyond."""
FIRST_SEED = 500
"""Of greenhouses and weather; policies are trained on seeds from a million on, templates on others below."""
PARTS = ("income", "heat", "electricity", "co2", "upkeep")


@dataclass(frozen=True)
class Situation:
    """What a strategy knows of one greenhouse when it chooses."""

    time: np.datetime64
    present: Mapping[str, float]
    applied: Floats
    forecast: Floats
    """(HORIZON, 6)."""
    recipe: Floats
    """(HORIZON, S)."""
    co2_before: float
    """kg m-2 since the beginning."""
    simulator: Simulator
    """Corrected by what the last days used and grew."""
    seed: int
    memory: Memory | None
    """What the crop has had, as its limits count it."""


Day = tuple[dict[str, Floats], dict[str, Floats], tuple[float, float], tuple[float, float]]
"""What the simulator says of a day that has passed, what it used and grew, what drove its growth, and how warm the air
was expected to be and was, degC."""
Strategy = Callable[[Situation], Floats]
"""Returns setpoints (HORIZON, S)."""


@dataclass
class Book:
    """What one strategy expected and obtained at each choice, EUR m-2, (greenhouses,), by part of the balance."""

    expected: dict[str, list[Floats]] = field(default_factory=dict)
    obtained: dict[str, list[Floats]] = field(default_factory=dict)
    harvest: list[Floats] = field(default_factory=list)
    seconds: float = 0.0


def note(column: dict[str, list[Floats]], site: Site, time: np.datetime64, outcome: Outcome, co2: Floats) -> None:
    """Book what an outcome (M, N, H) is worth, by parts, where the crops have had `co2` kg m-2 (N,) before."""
    hours = time + np.arange(outcome.heat.shape[-1]) * np.timedelta64(3600, "s")
    worth = Objective(site, hours, co2).value(outcome)
    for name in PARTS:
        column.setdefault(name, []).append(getattr(worth.balance, name).mean(axis=0))
    column.setdefault("harm", []).append(worth.harm.mean(axis=0))
    column.setdefault("profit", []).append(worth.profit.mean(axis=0))


def beside(outcomes: Sequence[Outcome]) -> Outcome:
    """Return outcomes of one candidate each as one of many."""
    return Outcome(
        **{one.name: np.concatenate([getattr(each, one.name) for each in outcomes], axis=1) for one in fields(Outcome)}
    )


def lead(
    site: Site,
    scenario: Scenario,
    strategies: Mapping[str, Strategy],
    simulator: BundleSimulator,
    every: int,
    forecast: str,
    corrected: bool,
) -> dict[str, Book]:
    """Lead copies of the same greenhouses by each strategy, which chooses anew every `every` hours."""
    greenhouses = Greenhouses(site, scenario)
    for _ in range(SETTLING):
        # A grown crop is set down in the greenhouse; it and the soil need days to fit each other.
        greenhouses.advance(
            np.repeat(recipe_by_hour(greenhouses.time, 24, site.longitude)[None], greenhouses.count, axis=0)
        )
    books = {name: Book() for name in strategies}
    co2 = np.zeros(greenhouses.count)
    past: list[deque[Day]] = [deque(maxlen=round(RECENT_DAYS * 24 / every)) for _ in range(greenhouses.count)]
    for choice in range((scenario.days - SETTLING) * 24 // every):
        begin = greenhouses.time
        present, applied = greenhouses.measurements(), greenhouses.applied()
        recipe = recipe_by_hour(begin, HORIZON, site.longitude)
        coming = greenhouses.coming_weather(HORIZON)
        chosen, expected, states = [], [], []
        for place, (name, strategy) in enumerate(strategies.items()):
            for greenhouse in range(scenario.count):
                row = place * scenario.count + greenhouse
                if forecast == "persistence":
                    weather = persistence(
                        _past(greenhouses.weather[greenhouse], begin), int(unix_seconds(begin)), HORIZON
                    )
                else:
                    weather = coming[row]
                now = {key: float(value[row]) for key, value in present.items()}
                model = recently(simulator, site, past[row]) if corrected else simulator
                seed = 1000 * choice + greenhouse
                had = greenhouses.memory(row)
                situation = Situation(begin, now, applied[row], weather, recipe, float(co2[row]), model, seed, had)
                began = time.monotonic()
                setpoints = strategy(situation)
                books[name].seconds += time.monotonic() - began
                chosen.append(setpoints)
                states.append(now)
                expected.append(model.simulate(now, weather, setpoints[None], begin).first(every))
        outcome = greenhouses.advance(np.stack(chosen)[:, :every])
        for row, now in enumerate(states):
            again = simulator.simulate(now, coming[row], chosen[row][None], begin).first(every)
            used = {name: each[[row]] for name, each in totals(outcome).items()}
            driven = (0.0, 0.0) if simulator.growth is None else grown_days(simulator.growth, again)
            air = float(again.air_temperature.mean()), float(outcome.air_temperature[:, row].mean())
            past[row].append((totals(again), used, driven, air))
        for place, book in enumerate(books.values()):
            part = slice(place * scenario.count, (place + 1) * scenario.count)
            mine = Outcome(**{one.name: getattr(outcome, one.name)[:, part] for one in fields(Outcome)})
            note(book.expected, site, begin, beside(expected[part]), co2[part])
            note(book.obtained, site, begin, mine, co2[part])
            hours = begin + np.arange(every) * np.timedelta64(3600, "s")
            picked = mine.fruit_fresh_weight[0]
            day = local_days(hours, site.time_zone)
            income = harvest_income(site.prices, day, picked, 0.0 * picked, site.crop.brix)
            book.harvest.append(income.sum(axis=-1))
        co2 = co2 + outcome.co2[0].sum(axis=-1)
        print(f"\r{begin} ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return books


def recently(simulator: BundleSimulator, site: Site, days: Iterable[Day]) -> Corrected:
    """Return the simulator corrected by what was expected of the last days and what they used and grew."""
    found = list(days)
    factor = factors(
        *(
            {name: np.array([float(total[name][0]) for total in side]) for name in SCALED}
            for side in ([day[0] for day in found], [day[1] for day in found])
        )
    )
    air = warmer(*np.array([day[3] for day in found]).reshape(-1, 2).T)
    balance = simulator.growth
    if balance is None:
        return Corrected(simulator, factor, warmer=air)
    grown = [float(day[1]["net_growth"][0]) for day in found]
    growth = growth_of_days(balance, site.crop, [day[2] for day in found], grown)
    return Corrected(simulator, factor, balance, growth, air)


def _past(weather: Telemetry, now: np.datetime64) -> Telemetry:
    return weather.select(now - 3 * DAY, now)


def genetic(site: Site, ahead: int = HORIZON) -> Strategy:
    """Return the elitist genetic algorithm on the bundle's simulator, which looks so many hours ahead."""

    def choose(now: Situation) -> Floats:
        state = PlanningState(
            now.time,
            now.present,
            dict(zip(SETPOINTS, now.applied, strict=True)),
            co2_before=now.co2_before,
            memory=now.memory,
        )
        rng = np.random.default_rng(now.seed)
        found = optimise(now.simulator, site, state, now.forecast[:ahead], now.recipe[:ahead], rng)
        return np.concatenate([found.setpoints, now.recipe[ahead:]])

    return choose


def policy_strategy(site: Site, policy: OnnxPolicy) -> Strategy:
    """Return the policy as a strategy."""
    day = slice(0, POLICY_HOURS)

    def choose(now: Situation) -> Floats:
        asked = now.recipe.copy()
        asked[day, PAPER_COLUMNS] = policy.plan(site, now.present, now.forecast[day], now.time)
        return asked

    return choose


def best_template(site: Site, simulator: Simulator, count: int = 500) -> Strategy:
    """Return the one day, of `count` random ones, that is worth most in the simulator over 12 days of other weather."""
    rng = np.random.default_rng(1)
    score = np.zeros(count)
    genes: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)
    for number, begin in enumerate(STARTS):
        start = np.datetime64(begin)
        scenario = Scenario(start, 4, 1, seed=FIRST_SEED - 100 + number)
        weather = Greenhouses(site, scenario).weather[0]
        for day in range(scenario.days):
            at = start + day * DAY
            template = for_site(site, at, HORIZON)
            if not genes.size:
                genes = template.draw(rng, count)
            candidates = template.decode(
                genes, recipe_by_hour(at, HORIZON, site.longitude), np.full(len(SETPOINTS), np.nan)
            )
            outcome = simulator.simulate({}, hourly_weather(weather, at, HORIZON), candidates, at)
            hours = at + np.arange(HORIZON) * np.timedelta64(3600, "s")
            score += Objective(site, hours).value(outcome).score.mean(axis=0)
    best = genes[[int(score.argmax())]]
    return lambda now: for_site(site, now.time, HORIZON).decode(best, now.recipe, np.full(len(SETPOINTS), np.nan))[0]


def table(title: str, books: Mapping[str, Sequence[Book]], days: int) -> dict[str, dict[str, float]]:
    """Print what each strategy expected and obtained in EUR m-2 a day, and return it."""
    print(f"\n{title}: EUR m-2 a day")
    heads = ("growth", "heat", "electr.", "CO2", "upkeep", "profit", "gain", "+-", "harm", "harvest", "s/plan")
    print(f"{'':34s}" + "".join(f"{head:>9s}" for head in heads))
    result = {}

    def daily(lists: Sequence[Sequence[Floats]]) -> Floats:
        """One value for each greenhouse and season."""
        return np.concatenate([np.sum(one, axis=0) for one in lists]) / days

    first = next(iter(books))
    for name, each in books.items():
        row = {}
        for kind in ("expected", "obtained"):
            parts = {part: daily([getattr(book, kind)[part] for book in each]) for part in (*PARTS, "profit", "harm")}
            reference = daily([getattr(book, kind)["profit"] for book in books[first]])
            gain = parts["profit"] - reference
            error = gain.std(ddof=1) / np.sqrt(len(gain)) if len(gain) > 1 else float("nan")
            cells = "".join(f"{parts[part].mean():9.4f}" for part in (*PARTS, "profit"))
            cells += f"{gain.mean():+9.4f}{error:9.4f}{parts['harm'].mean():9.4f}"
            if kind == "obtained":
                costs = sum(parts[part] for part in PARTS if part != "income")
                harvest = daily([book.harvest for book in each]) - costs
                plans = sum(len(book.harvest) * book.harvest[0].size for book in each)
                cells += f"{harvest.mean():9.4f}{sum(book.seconds for book in each) / plans:9.2f}"
                row["harvest_less_costs"] = float(harvest.mean())
            print(f"{name if kind == 'expected' else '':24s}{kind:10s}{cells}")
            row |= {f"{kind}_{part}": float(values.mean()) for part, values in parts.items()}
            row |= {f"{kind}_gain": float(gain.mean()), f"{kind}_gain_standard_error": float(error)}
        result[name] = row
    return result


def main() -> int:
    """Run and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, default=default_bundle_folder(), help="whose simulator plans")
    parser.add_argument("--policy", action="append", default=[], metavar="NAME=FILE", help="a policy.onnx to compare")
    parser.add_argument("--days", type=int, default=14)
    parser.add_argument("--greenhouses", type=int, default=4, help="greenhouses in each season")
    parser.add_argument("--every", type=int, default=24, help="hours between choices (K1)")
    parser.add_argument("--forecast", choices=("persistence", "true"), default="persistence", help="weather ahead")
    parser.add_argument("--uncorrected", action="store_true", help="do not correct plans by what the last days used")
    parser.add_argument("--starts", nargs="+", default=STARTS, metavar="DATE", help=f"of {', '.join(STARTS)}")
    parser.add_argument("--only", nargs="+", help="strategies to run beside the recipe")
    parser.add_argument("--json", type=Path, help="file for the tables")
    given = parser.parse_args()
    site = load_site(SITE)
    simulator = BundleSimulator(read_bundle(given.bundle), site.greenhouse)
    strategies: dict[str, Strategy] = {
        "recipe": lambda now: now.recipe,
        "best of 500 fixed days": best_template(site, simulator),
        "genetic algorithm": genetic(site),
        "one day alone": genetic(site, 24),
    }
    for text in given.policy:
        name, _, path = text.partition("=")
        policy = OnnxPolicy(path)
        strategies[name] = policy_strategy(site, policy)
    if given.only:
        strategies = {name: one for name, one in strategies.items() if name in ("recipe", *given.only)}
    found: dict[str, list[Book]] = {name: [] for name in strategies}
    result: dict[str, object] = {}
    for number, start in enumerate(STARTS):
        if not start.startswith(tuple(given.starts)):
            continue
        begin = np.datetime64(start) - SETTLING * DAY
        days, copies = SETTLING + given.days, len(strategies)
        scenario = Scenario(begin, days, given.greenhouses, seed=FIRST_SEED + number, copies=copies)
        books = lead(site, scenario, strategies, simulator, given.every, given.forecast, not given.uncorrected)
        for name, book in books.items():
            found[name].append(book)
        title = f"{given.days} days from {start[:10]}, {given.greenhouses} greenhouses"
        result[start] = table(title, {name: [book] for name, book in books.items()}, given.days)
    result["all"] = table("all seasons", found, given.days)
    if given.json is not None:
        given.json.write_text(json.dumps(result, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
