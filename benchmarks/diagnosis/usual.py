"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.houses import LEARNING_SEED, PLACES_SEED, House, elsewhere, neighbours, of_seasons
from benchmarks.diagnosis.logs import MISMATCH, built_in, reference
from igrow.core.bundle import BUILT_IN
from igrow.core.greenhouse import Disturbances, recipe, simulate_many
from igrow.core.greenhouse.described import parameters_of
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import Deployed, problem, usual
from igrow.trainer.diagnosis.problem import Problem

HOUSES = 12
"""Drawn as those elsewhere are, beside the house of the cases in winter and spring and that of the default bundle."""
LOGS = 12
"""Of each family and length."""
PLACES, NEIGHBOURS = 16, 12
"""Where the built-in bundle is all that is known of greenhouses, and how many of them stand there."""
MONTH, SEASON = 28, 84
"""Days of a log."""
FOLDS = 4
"""In which families are left out to see how well directions carry."""
SEASONS_FROM = 2
"""Families, the first ones, that have logs of a season too."""
DEFAULT_SITE = Site(name=BUILT_IN, latitude=52.03, longitude=4.52)

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
    known = [own["winter"], own["spring"], *learned]
    seeds = [20_000, 30_000, *(81_000 + 100 * number for number in range(HOUSES))]
    found: list[Family] = []
    with ProcessPoolExecutor(processes) as pool:
        for one, seed in zip(pool.map(reference, known), seeds, strict=True):
            found.append(Family(one.house, one.deployed, seed))
            print(f"calibrated {len(found)} of {len(known)}: {one.house.site.name}", file=sys.stderr)
    default = House(DEFAULT_SITE, parameters_of(DEFAULT_SITE), np.datetime64("2020-02-01T00:00:00"), 40_000)
    return [*found, Family(default, built_in(DEFAULT_SITE), default.seed)]


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
    seen = prepare_log(log, site)
    record = seen.record(seen.best_shift(deployed.parameters) if deployed.shift is None else deployed.shift)
    days = split_days(record, site.longitude)
    return problem.prepare(record, days, deployed.prior, {}, site.longitude, deployed.known_misfit, directions)


def _traces(family: Family) -> list[usual.Traces]:
    return [usual.traces(prepare(family, log)) for log in simulate(family, MONTH)]


def _traces_elsewhere(place: House) -> list[usual.Traces]:
    """Return the traces of greenhouses at a place of which only the built-in bundle is known."""
    some = neighbours(place, NEIGHBOURS)
    end = place.start + np.timedelta64(MONTH, "D")
    logs = simulate_many(
        [one.plant for one in some],
        [one.weather(one.start, end, one.seed) for one in some],
        recipe,
        place.start,
        end,
        count=len(some),
        seed=place.seed,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    return [
        usual.traces(prepare(Family(one, built_in(one.site), one.seed), log.measured))
        for one, log in zip(some, logs, strict=True)
    ]


def _amplitudes(directions: Directions, family: Family) -> list[dict[str, float]]:
    return [usual.amplitudes(prepare(family, log, directions)) for log in simulate(family, SEASON)]


def _directions(
    what: str, groups: Iterable[Sequence[usual.Traces]], expected: int, count: int
) -> list[dict[str, float]]:
    """Return `count` directions of all groups of logs, and print how well they carry from one group to another."""
    traces: list[Sequence[usual.Traces]] = []
    for some in groups:
        traces.append(some)
        print(f"{what}: traces of {len(traces)} of {expected}", file=sys.stderr)
    shares = ", ".join(f"{share:.0f}" for share in carried(traces, count))
    print(f"{what}: log marginal likelihood of a log in houses not learned from, {FOLDS} folds: {shares}")
    return usual.directions([log for logs in traces for log in logs], count)


def carried(traces: Sequence[Sequence[usual.Traces]], count: int) -> list[float]:
    """Return how well directions carry to houses that they were not learned from: the evidence of each log there.

    Args:
        traces: of the logs of each family or place; every fourth is left out in turn.
        count: of directions.
    """
    shares = []
    for turn in range(FOLDS):
        others = [log for number, logs in enumerate(traces) if number % FOLDS != turn for log in logs]
        unseen = [log for logs in traces[turn::FOLDS] for log in logs]
        shares.append(usual.evidence(usual.directions(others, count), unseen) / len(unseen))
    return shares


def learn(known: Sequence[Family], processes: int) -> usual.Usual:
    """Return what is usual between the greenhouses of families."""
    with ProcessPoolExecutor(processes) as pool:
        directions = _directions("calibrated before", pool.map(_traces, known), len(known), usual.DIRECTIONS)
        places = elsewhere(PLACES, PLACES_SEED).values()
        found = pool.map(_traces_elsewhere, places)
        unknown = _directions("by the built-in bundle", found, PLACES, usual.DIRECTIONS_ELSEWHERE)
        shown: list[dict[str, float]] = []
        for number, seen in enumerate(pool.map(partial(_amplitudes, directions), known[:SEASONS_FROM]), 1):
            shown += seen
            print(f"seasons of {number} of {SEASONS_FROM} families", file=sys.stderr)
    return usual.Usual(tuple(directions), tuple(unknown), usual.root_mean_squares(shown))


def main(processes: int) -> int:
    """Write what is usual into the package."""
    found = learn(families(processes), processes)
    path = Path(str(files("igrow.trainer.diagnosis"))) / usual.FILE
    usual.write(path, found)
    print(f"wrote {len(found.directions)} directions and {len(found.season)} usual amplitudes to {path}")
    return 0
