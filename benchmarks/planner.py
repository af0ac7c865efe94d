"""Planners side by side, judged in the mechanistic greenhouse under weather and on plants that none was fitted to.

    python -m benchmarks.planner plans  [--cases 4] [--policy policy.onnx] [--bundle FOLDER]
    python -m benchmarks.planner daily  [--policy policy.onnx]
    python -m benchmarks.planner speed

`plans`: two days each, the recipe, the best of random templates and the genetic algorithm (equal numbers of
simulated candidates), the policy, and the search that starts from the policy. They search on the mechanistic
greenhouse itself, which is a perfect model, or on a bundle's simulator. `daily`: ten days in 32 greenhouses: policy,
recipe, and the template of one day that was best on other weather. `speed`: generations a second, no simulator.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.greenhouse import GreenhouseParameters, generate_weather
from igrow.core.greenhouse import recipe as growers_recipe
from igrow.core.planner import Budget, EvolutionSettings, NumpyGeneration, Objective, PlanningState, optimise
from igrow.core.planner.evolution import draw
from igrow.core.planner.objective import Simulator, Valuation
from igrow.core.planner.onnx_generation import OnnxGeneration
from igrow.core.planner.plant_simulator import PlantSimulator
from igrow.core.planner.policy import HOURS, OnnxPolicy, to_setpoints
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Site, load_site
from igrow.trainer.exporting.optimizer import export_optimizer
from igrow.trainer.research.policies.environment import DailyGreenhouses, Scenario, hourly_weather

DAY = np.timedelta64(86_400, "s")
SETTINGS = EvolutionSettings(parents=24, offspring=48)
DAYS, COUNT = 10, 32
"""Of `daily`."""
SITE = Path(__file__).resolve().parents[1] / "config" / "site.yaml"


def recipe_table(site: Site, start: np.datetime64, hours: int) -> np.ndarray:
    times = start + np.arange(hours) * np.timedelta64(3600, "s")
    return np.array([[growers_recipe(time, site.longitude)[name] for name in SETPOINTS] for time in times])


def table_line(name: str, valuations: list[Valuation], reference: list[Valuation], days: float) -> str:
    score = np.array([v.score.mean() for v in valuations]) / days
    gain = score - np.array([v.score.mean() for v in reference]) / days
    money = [
        np.mean([getattr(v.balance, key).mean() for v in valuations]) / days
        for key in ("income", "heat", "electricity", "co2")
    ]
    harm = np.mean([v.harm.mean() for v in valuations]) / days
    error = gain.std(ddof=1) / np.sqrt(len(gain)) if len(gain) > 1 else float("nan")
    cells = "".join(f"{value:9.4f}" for value in (*money, harm, score.mean(), gain.mean(), error))
    return f"{name:24s}{cells}"


HEADER = f"{'EUR m-2 a day':24s}" + "".join(
    f"{name:>9s}" for name in ("growth", "heat", "electr.", "co2", "harm", "score", "gain", "+-")
)


def plans(arguments: argparse.Namespace) -> None:
    site = load_site(SITE)
    hours = 48
    budget = Budget(generations=arguments.generations, patience=arguments.generations)
    policy = OnnxPolicy(arguments.policy) if arguments.policy else None
    results: dict[str, list[Valuation]] = {}
    seconds: dict[str, float] = {}

    def note(name: str, plant: PlantSimulator, setpoints: np.ndarray, objective: Objective, began: float) -> None:
        outcome = plant.simulate({}, np.zeros((hours, 6)), setpoints[None], plant.time)
        results.setdefault(name, []).append(objective.value(outcome))
        seconds[name] = seconds.get(name, 0.0) + time.monotonic() - began

    for case in range(arguments.cases):
        rng = np.random.default_rng(case)
        start = np.datetime64("2020-01-10T23:00:00") + int(rng.integers(100)) * DAY
        weather = generate_weather(start - 2 * DAY, start + 4 * DAY, seed=case)
        plant = PlantSimulator(GreenhouseParameters().varied(rng), weather, start - DAY)
        plant.follow(recipe_table(site, start - DAY, 24))
        model: Simulator = plant
        if arguments.bundle:
            from igrow.core.bundle import read_bundle  # noqa: PLC0415 - not every run has a bundle
            from igrow.core.simulator.plan import BundleSimulator  # noqa: PLC0415

            model = BundleSimulator(read_bundle(arguments.bundle), site.greenhouse)
        state = PlanningState(start, plant.measurements())
        forecast = hourly_weather(weather, start, hours)
        recipe = recipe_table(site, start, hours)
        objective = Objective(site, start + np.arange(hours) * np.timedelta64(3600, "s"))
        template = for_site(site, start, hours)

        note("recipe", plant, recipe, objective, time.monotonic())
        began = time.monotonic()
        count = SETTINGS.offspring * arguments.generations
        genes = template.draw(rng, count)
        best, best_score = recipe, -np.inf
        for first in range(0, count, SETTINGS.offspring):
            candidates = template.decode(genes[first : first + SETTINGS.offspring], recipe, np.full(4, np.nan))
            outcome = model.simulate(dict(state.initial), forecast, candidates, start)
            scores = objective.value(outcome).score.mean(axis=0)
            if scores.max() > best_score:
                best, best_score = candidates[int(scores.argmax())], scores.max()
        note(f"best of {count} random", plant, best, objective, began)

        searches: dict[str, tuple[Any, ...]] = {"genetic algorithm": ()}
        if policy:
            began = time.monotonic()
            drawn = template.limit(policy.plan(site, state.initial, forecast, start), np.full(4, np.nan))
            note("policy", plant, drawn, objective, began)
            searches["genetic, from policy"] = (drawn,)
        for name, seeds in searches.items():
            began = time.monotonic()
            run = NumpyGeneration(SETTINGS)
            found = optimise(
                model, site, state, forecast, recipe, np.random.default_rng(case), budget, generation=run, seeds=seeds
            )
            note(name, plant, found.setpoints, objective, began)
        print(f"case {case}: {start}", flush=True)
    print(HEADER + f"{'s/plan':>9s}")
    for name, valuations in results.items():
        line = table_line(name, valuations, results["recipe"], hours / 24)
        print(line + f"{seconds[name] / arguments.cases:9.1f}")


def daily(arguments: argparse.Namespace) -> None:
    site = load_site(SITE)
    rng = np.random.default_rng(1)
    train = Scenario(np.datetime64("2020-01-24T23:00:00"), 2, 500, seed=900_001)
    template = for_site(replace(site, planning=replace(site.planning, optimise=SETPOINTS)), train.start, HOURS)
    genes = template.draw(rng, 500)
    scores = np.zeros(500)
    for month in range(3):
        scenario = replace(train, start=train.start + 30 * month * DAY)
        world = DailyGreenhouses(site, scenario)
        day = template.decode(genes, recipe_table(site, scenario.start, HOURS), np.full(4, np.nan))
        while not world.done:
            scores += world.step(day).score[0]
    fixed = template.decode(genes[[int(scores.argmax())]], np.zeros((HOURS, 4)), np.full(4, np.nan))
    some = template.decode(genes[:COUNT], np.zeros((HOURS, 4)), np.full(4, np.nan))

    methods: dict[str, Any] = {
        "recipe": lambda world: np.repeat(recipe_table(site, world.time, HOURS)[None], COUNT, axis=0),
        "random template": lambda world: some,
        "best of 500 templates": lambda world: np.repeat(fixed, COUNT, axis=0),
    }
    if arguments.policy:
        policy = OnnxPolicy(arguments.policy)
        methods["policy"] = lambda world: to_setpoints(site, policy.act(world.observe()[:COUNT]))
    starts = [np.datetime64("2020-01-14T23:00:00") + 30 * month * DAY for month in range(3)]
    runs: dict[str, list[Valuation]] = {name: [] for name in methods}
    for number, start in enumerate(starts):
        world = DailyGreenhouses(site, Scenario(start, DAYS, COUNT, seed=number, copies=len(methods)))
        days = []
        while not world.done:
            days.append(world.step(np.concatenate([method(world) for method in methods.values()])))
        for place, name in enumerate(methods):
            part = slice(place * COUNT, (place + 1) * COUNT)
            # Days of one run depend on one another; its mean is one observation.
            runs[name].append(_mean([_slice(day, part) for day in days]))
    print(HEADER)
    for name, valuations in runs.items():
        print(table_line(name, valuations, runs["recipe"], 1.0))


def _slice(valuation: Valuation, part: slice) -> Valuation:
    balance = valuation.balance
    cut = {field.name: getattr(balance, field.name)[:, part] for field in fields(balance)}
    return Valuation(type(balance)(**cut), valuation.harm[:, part], valuation.outside[:, part])


def _mean(valuations: list[Valuation]) -> Valuation:
    total = valuations[0]
    for other in valuations[1:]:
        total = Valuation(total.balance + other.balance, total.harm + other.harm, total.outside + other.outside)
    count = len(valuations)
    names = ("income", "plants", "upkeep", "electricity", "heat", "co2")
    balance = type(total.balance)(*(getattr(total.balance, name) / count for name in names))
    return Valuation(balance, total.harm / count, total.outside / count)


def speed(_: argparse.Namespace) -> None:
    rng = np.random.default_rng(0)
    settings = EvolutionSettings()
    genes = 48
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "optimizer.onnx"
        model = export_optimizer(settings)
        path.write_bytes(model.SerializeToString())
        print(f"optimizer.onnx: {len(model.graph.node)} nodes, {path.stat().st_size} bytes")
        for name, run in (("numpy", NumpyGeneration(settings)), ("optimizer.onnx", OnnxGeneration(path))):
            parents = rng.random((settings.parents, genes), dtype=np.float32)
            offspring = rng.random((settings.offspring, genes), dtype=np.float32)
            fitness = rng.standard_normal(settings.parents).astype(np.float32)
            values = rng.standard_normal(settings.offspring).astype(np.float32)
            random = draw(rng, settings, genes)
            began = time.perf_counter()
            for _turn in range(1000):
                parents, fitness, offspring = run(parents, fitness, offspring, values, random)
            rate = 1000 / (time.perf_counter() - began)
            print(f"{name:16s}{rate:9.0f} generations/s of {settings.offspring} candidates of {genes} genes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for name, function in (("plans", plans), ("daily", daily), ("speed", speed)):
        command = commands.add_parser(name)
        command.set_defaults(function=function)
        if name != "speed":
            command.add_argument("--policy", type=Path)
        if name == "plans":
            command.add_argument("--cases", type=int, default=4)
            command.add_argument("--generations", type=int, default=20)
            command.add_argument("--bundle", type=Path)
    arguments = parser.parse_args()
    arguments.function(arguments)


if __name__ == "__main__":
    main()
