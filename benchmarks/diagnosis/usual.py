"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.logs import MISMATCH, SITE, reference
from igrow_core.bundle import default_bundle_folder, read_bundle
from igrow_core.greenhouse import Disturbances, GreenhouseParameters, generate_weather, recipe, simulate_many
from igrow_core.greenhouse.described import parameters_of
from igrow_core.site import Site
from trainer.diagnosis import Deployed, from_manifest, problem, runner, usual
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.split import split_days

LOGS = 30
"""Of each family."""
DAYS = 28
FAMILIES = ("winter", "spring", "default")
DEFAULT_SITE = Site(name="default", latitude=52.03, longitude=4.52)


@dataclass(frozen=True)
class Family:
    """Greenhouses of a kind, with the model that is calibrated on one of them."""

    start: str
    seed: int
    """Of the first log; no case has it, nor any of those after it."""
    site: Site
    deployed: Deployed
    plant: GreenhouseParameters


def family(name: str) -> Family:
    """Return the greenhouses of a season of the benchmark, or those of the default bundle."""
    if name == "default":
        bundle = read_bundle(default_bundle_folder())
        deployed = from_manifest(bundle.manifest)
        return Family("2020-02-01", 40_000, DEFAULT_SITE, deployed, parameters_of(DEFAULT_SITE))
    seed = {"winter": 20_000, "spring": 30_000}[name]
    return Family(SEASONS[name], seed, SITE, reference(name).deployed, GreenhouseParameters())


def problems(name: str) -> list[Problem]:
    """Return the prepared problems of a family's logs, each without usual directions of its own."""
    own = family(name)
    start = np.datetime64(f"{own.start}T00:00:00")
    end = start + np.timedelta64(DAYS, "D")
    seeds = range(own.seed, own.seed + LOGS)
    logs = simulate_many(
        [own.plant.varied(np.random.default_rng(seed), relative=MISMATCH) for seed in seeds],
        [generate_weather(start, end, seed=seed) for seed in seeds],
        recipe,
        start,
        end,
        count=LOGS,
        seed=own.seed,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    found = []
    for log in logs:
        record, _ = runner.open_record(log.measured, own.site, own.deployed)
        days = split_days(record, own.site.longitude)
        known = own.deployed.known_misfit
        found.append(problem.prepare(record, days, own.deployed.prior, {}, own.site.longitude, known))
    return found


def main() -> int:
    """Write the directions into the package."""
    with ProcessPoolExecutor(len(FAMILIES)) as pool:
        prepared = [one for part in pool.map(problems, FAMILIES) for one in part]
    path = Path(str(files("trainer.diagnosis"))) / usual.FILE
    path.write_text(json.dumps(usual.directions(prepared)) + "\n", encoding="utf-8")
    print(f"wrote {usual.DIRECTIONS} directions from {len(prepared)} logs to {path}")
    return 0
