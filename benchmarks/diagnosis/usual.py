"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.houses import LEARNING_SEED, House, elsewhere, of_seasons
from benchmarks.diagnosis.logs import MISMATCH, reference
from igrow_core.bundle import default_bundle_folder, read_bundle
from igrow_core.greenhouse import Disturbances, recipe, simulate_many
from igrow_core.greenhouse.described import parameters_of
from igrow_core.site import Site
from igrow_core.telemetry import Telemetry
from trainer.diagnosis import Deployed, from_manifest, problem, runner, usual
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.split import split_days

HOUSES = 12
"""Drawn as those elsewhere are, beside the house of the cases in winter and spring and that of the default bundle."""
LOGS = 12
"""Of each family and length."""
MONTH, SEASON = 28, 84
"""Days of a log."""
FOLDS = 4
"""In which families are left out to see how well directions carry."""
SEASONS_FROM = 2
"""Families, the first ones, that have logs of a season too."""
DEFAULT_SITE = Site(name="default", latitude=52.03, longitude=4.52)

Directions = Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class Family:
    """Greenhouses about a house, and the model that is calibrated on it."""

    house: House
    deployed: Deployed
    seed: int
    """Of the first log of a month; no case has it, nor any of those after it."""


def families(processes: int) -> list[Family]:
    """Calibrate the models of all families."""
    own = of_seasons()
    learned = elsewhere(HOUSES, LEARNING_SEED).values()
    houses = [own["winter"], own["spring"], *learned]
    seeds = [20_000, 30_000, *(81_000 + 100 * number for number in range(HOUSES))]
    found: list[Family] = []
    with ProcessPoolExecutor(processes) as pool:
        for one, seed in zip(pool.map(reference, houses), seeds, strict=True):
            found.append(Family(one.house, one.deployed, seed))
            print(f"calibrated {len(found)} of {len(houses)}: {one.house.site.name}", file=sys.stderr)
    default = House(DEFAULT_SITE, parameters_of(DEFAULT_SITE), np.datetime64("2020-02-01T00:00:00"), 40_000)
    manifest = read_bundle(default_bundle_folder()).manifest
    return [*found, Family(default, from_manifest(manifest), default.seed)]


def simulate(family: Family, days: int) -> list[Telemetry]:
    """Return the logs of a family's greenhouses."""
    house = family.house
    end = house.start + np.timedelta64(days, "D")
    first = family.seed if days == MONTH else family.seed + 5_000
    logs = simulate_many(
        [house.plant.varied(np.random.default_rng(first + k), relative=MISMATCH) for k in range(LOGS)],
        [house.weather(house.start, end, first + k) for k in range(LOGS)],
        recipe,
        house.start,
        end,
        count=LOGS,
        seed=first,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    return [log.measured for log in logs]


def prepare(family: Family, log: Telemetry, directions: Directions = ()) -> Problem:
    """Return the prepared problem of a family's log."""
    site, deployed = family.house.site, family.deployed
    record, _ = runner.open_record(log, site, deployed)
    days = split_days(record, site.longitude)
    return problem.prepare(record, days, deployed.prior, {}, site.longitude, deployed.known_misfit, directions)


def _traces(family: Family) -> list[usual.Traces]:
    return [usual.traces(prepare(family, log)) for log in simulate(family, MONTH)]


def _amplitudes(directions: Directions, family: Family) -> list[dict[str, float]]:
    return [usual.amplitudes(prepare(family, log, directions)) for log in simulate(family, SEASON)]


def carried(traces: Sequence[Sequence[usual.Traces]]) -> list[float]:
    """Return how well directions carry to houses that they were not learned from: the evidence of each log there.

    Args:
        traces: of the logs of each family; every fourth is left out in turn.
    """
    shares = []
    for turn in range(FOLDS):
        others = [log for number, logs in enumerate(traces) if number % FOLDS != turn for log in logs]
        unseen = [log for logs in traces[turn::FOLDS] for log in logs]
        shares.append(usual.evidence(usual.directions(others), unseen) / len(unseen))
    return shares


def learn(known: Sequence[Family], processes: int) -> usual.Usual:
    """Return what is usual between the greenhouses of families."""
    with ProcessPoolExecutor(processes) as pool:
        traces: list[list[usual.Traces]] = []
        for some in pool.map(_traces, known):
            traces.append(some)
            print(f"traces of {len(traces)} of {len(known)} families", file=sys.stderr)
        directions = usual.directions([log for logs in traces for log in logs])
        shares = ", ".join(f"{share:.0f}" for share in carried(traces))
        print(f"log marginal likelihood of a log in houses not learned from, {FOLDS} folds: {shares}")
        shown: list[dict[str, float]] = []
        for number, seen in enumerate(pool.map(partial(_amplitudes, directions), known[:SEASONS_FROM]), 1):
            shown += seen
            print(f"seasons of {number} of {SEASONS_FROM} families", file=sys.stderr)
    return usual.Usual(tuple(directions), usual.root_mean_squares(shown))


def main(processes: int) -> int:
    """Write what is usual into the package."""
    found = learn(families(processes), processes)
    path = Path(str(files("trainer.diagnosis"))) / usual.FILE
    usual.write(path, found)
    print(f"wrote {len(found.directions)} directions and {len(found.season)} usual amplitudes to {path}")
    return 0
