"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.houses import of_seasons
from benchmarks.diagnosis.logs import MISMATCH, reference
from igrow_core.bundle import default_bundle_folder, read_bundle
from igrow_core.greenhouse import Disturbances, GreenhouseParameters, generate_weather, recipe, simulate_many
from igrow_core.greenhouse.described import parameters_of
from igrow_core.site import Site
from igrow_core.telemetry import Telemetry
from trainer.diagnosis import Deployed, from_manifest, problem, runner, usual
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.split import split_days

LOGS = 30
"""Of each family."""
MONTH, SEASON = 28, 84
"""Days of a log."""
FAMILIES = (("winter", MONTH), ("spring", MONTH), ("default", MONTH), ("winter", SEASON), ("spring", SEASON))
"""Greenhouses and length of the logs."""
DEFAULT_SITE = Site(name="default", latitude=52.03, longitude=4.52)

Directions = Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class Family:
    """Greenhouses of a kind, with the model that is calibrated on one of them."""

    start: np.datetime64
    seed: int
    """Of the first log of a month; no case has it, nor any of those after it."""
    site: Site
    deployed: Deployed
    plant: GreenhouseParameters


@cache
def family(name: str) -> Family:
    """Return the greenhouses of a season of the benchmark, or those of the default bundle."""
    if name == "default":
        bundle = read_bundle(default_bundle_folder())
        deployed = from_manifest(bundle.manifest)
        return Family(np.datetime64("2020-02-01T00:00:00"), 40_000, DEFAULT_SITE, deployed, parameters_of(DEFAULT_SITE))
    seed = {"winter": 20_000, "spring": 30_000}[name]
    house = of_seasons()[name]
    return Family(house.start, seed, house.site, reference(house).deployed, house.plant)


def simulate(name: str, days: int) -> list[Telemetry]:
    """Return the logs of a family's greenhouses."""
    own = family(name)
    start = own.start
    end = start + np.timedelta64(days, "D")
    first = own.seed if days == MONTH else own.seed + 5_000
    logs = simulate_many(
        [own.plant.varied(np.random.default_rng(first + k), relative=MISMATCH) for k in range(LOGS)],
        [generate_weather(start, end, seed=first + k) for k in range(LOGS)],
        recipe,
        start,
        end,
        count=LOGS,
        seed=first,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    return [log.measured for log in logs]


def prepare(job: tuple[str, Telemetry], directions: Directions = ()) -> Problem:
    """Return the prepared problem of a family's log."""
    name, log = job
    own = family(name)
    record, _ = runner.open_record(log, own.site, own.deployed)
    days = split_days(record, own.site.longitude)
    known = own.deployed.known_misfit
    return problem.prepare(record, days, own.deployed.prior, {}, own.site.longitude, known, directions)


def _traces(job: tuple[str, Telemetry]) -> usual.Traces:
    return usual.traces(prepare(job))


def _amplitudes(directions: Directions, job: tuple[str, Telemetry]) -> dict[str, float]:
    return usual.amplitudes(prepare(job, directions))


def main(processes: int) -> int:
    """Write what is usual into the package."""
    with ProcessPoolExecutor(processes) as pool:
        logs = pool.map(simulate, *zip(*FAMILIES, strict=True))
        jobs: dict[int, list[tuple[str, Telemetry]]] = {MONTH: [], SEASON: []}
        for (name, days), own in zip(FAMILIES, logs, strict=True):
            jobs[days] += [(name, log) for log in own]
        directions = usual.directions(list(pool.map(_traces, jobs[MONTH])))
        shown = list(pool.map(partial(_amplitudes, directions), jobs[SEASON]))
    found = usual.Usual(tuple(directions), usual.root_mean_squares(shown))
    path = Path(str(files("trainer.diagnosis"))) / usual.FILE
    usual.write(path, found)
    print(f"wrote {len(directions)} directions and {len(found.season)} usual amplitudes to {path}")
    return 0
