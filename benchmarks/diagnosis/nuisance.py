"""Learn what greenhouses show though nothing is missing: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis import factor_analysis
from benchmarks.diagnosis.factor_analysis import LogLikelihood
from benchmarks.diagnosis.greenhouses import (
    LEARNING_SEED,
    PLACES_SEED,
    VirtualGreenhouse,
    neighbours,
    of_seasons,
    others,
)
from benchmarks.diagnosis.logs import MISMATCH, built_in, reference
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.core.bundle import BUILT_IN
from igrow.core.greenhouse import Disturbances, recipe, simulate_many
from igrow.core.greenhouse.described import parameters_of
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT, NuisanceSubspace, nuisance
from igrow.trainer.diagnosis.design import Design, prepare
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.nuisance import Direction
from igrow.trainer.diagnosis.rules import HOUR
from igrow.trainer.fit import FittedModel

KINDS = 12
"""Drawn as other greenhouses are, beside that of the cases in winter and spring and that of the default bundle."""
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

COMMAND = "python -m benchmarks.diagnosis nuisance"


@dataclass(frozen=True)
class Family:
    """Greenhouses about a greenhouse, and the model that is calibrated on it."""

    greenhouse: VirtualGreenhouse
    model: FittedModel
    seed: int
    """Of the first log of a month; no case has it, nor any of those after it."""


def families(processes: int) -> list[Family]:
    """Calibrate the models of all families."""
    own = of_seasons()
    learned = others(KINDS, LEARNING_SEED).values()
    known = [own["winter"], own["spring"], *learned]
    seeds = [20_000, 30_000, *(81_000 + 100 * number for number in range(KINDS))]
    found: list[Family] = []
    with Jobs("diagnosis families", processes) as jobs:
        for one, seed in zip(jobs.each(reference, known), seeds, strict=True):
            found.append(Family(one.greenhouse, one.model, seed))
            print(f"calibrated {len(found)} of {len(known)}: {one.greenhouse.site.name}", file=sys.stderr)
    default = VirtualGreenhouse(DEFAULT_SITE, parameters_of(DEFAULT_SITE), np.datetime64("2020-02-01T00:00:00"), 40_000)
    return [*found, Family(default, built_in(DEFAULT_SITE), default.seed)]


def simulate(family: Family, days: int) -> list[Telemetry]:
    """Return the logs of a family's greenhouses."""
    greenhouse = family.greenhouse
    end = greenhouse.start + np.timedelta64(days, "D")
    first = family.seed if days == MONTH else family.seed + 5_000
    logs = simulate_many(
        [greenhouse.plant.varied(np.random.default_rng(first + k), relative=MISMATCH) for k in range(LOGS)],
        [greenhouse.weather(greenhouse.start, end, first + k) for k in range(LOGS)],
        recipe,
        greenhouse.start,
        end,
        count=LOGS,
        seed=first,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    return [log.measured for log in logs]


def design_of(family: Family, log: Telemetry, directions: Sequence[Direction] = (), interval: float = HOUR) -> Design:
    """Return the design of a family's log."""
    site, model = family.greenhouse.site, family.model
    days = log_days(prepare_log(log, site), model)
    known = knowledge_of(model, site, DEFAULT)
    return prepare(
        days.record, days.split, known.short_prior, {}, site.longitude, DEFAULT,
        discrepancy=known.discrepancy, directions=directions, interval=interval,
    )  # fmt: skip


def at_home(family: Family) -> list[LogLikelihood]:
    """Return what the logs of a family say."""
    return [factor_analysis.marginal(design_of(family, log)) for log in simulate(family, MONTH)]


def transferred_logs(place: VirtualGreenhouse) -> list[tuple[Family, Telemetry]]:
    """Return logs of greenhouses at a place of which only the built-in bundle is known."""
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
    return [(Family(one, built_in(one.site), one.seed), log.measured) for one, log in zip(some, logs, strict=True)]


def transferred(place: VirtualGreenhouse) -> list[LogLikelihood]:
    """Return what logs at a place say of which only the built-in bundle is known."""
    return [factor_analysis.marginal(design_of(family, log)) for family, log in transferred_logs(place)]


def _amplitudes(directions: Sequence[Direction], family: Family) -> list[dict[str, float]]:
    return [factor_analysis.null_amplitudes(design_of(family, log, directions)) for log in simulate(family, SEASON)]


def _directions(
    what: str, groups: Iterable[Sequence[LogLikelihood]], expected: int, count: int
) -> list[dict[str, float]]:
    """Return `count` directions of all groups of logs, and print how well they carry from one group to another."""
    known: list[Sequence[LogLikelihood]] = []
    for some in groups:
        known.append(some)
        print(f"{what}: logs of {len(known)} of {expected}", file=sys.stderr)
    shares = ", ".join(f"{share:.0f}" for share in carried(known, count))
    print(f"{what}: log marginal likelihood of a log of greenhouses not learned from, {FOLDS} folds: {shares}")
    return factor_analysis.learn_directions([log for logs in known for log in logs], count)


def carried(known: Sequence[Sequence[LogLikelihood]], count: int) -> list[float]:
    """Return how well directions carry to greenhouses that they were not learned from: the evidence of each log there.

    Args:
        known: the logs of each family or place; every fourth is left out in turn.
        count: of directions.
    """
    shares = []
    for turn in range(FOLDS):
        others = [log for number, logs in enumerate(known) if number % FOLDS != turn for log in logs]
        unseen = [log for logs in known[turn::FOLDS] for log in logs]
        shares.append(factor_analysis.evidence(factor_analysis.learn_directions(others, count), unseen) / len(unseen))
    return shares


def learn(known: Sequence[Family], processes: int) -> NuisanceSubspace:
    """Return what greenhouses of families show though nothing is missing."""
    with Jobs("diagnosis nuisance", processes) as jobs:
        home = _directions("at home", jobs.each(at_home, known), len(known), DEFAULT.nuisance_directions)
        places = others(PLACES, PLACES_SEED).values()
        count = DEFAULT.nuisance_directions_transferred
        away = _directions("transferred", jobs.each(transferred, places), PLACES, count)
        shown: list[dict[str, float]] = []
        for number, seen in enumerate(jobs.each(partial(_amplitudes, home), known[:SEASONS_FROM]), 1):
            shown += seen
            print(f"seasons of {number} of {SEASONS_FROM} families", file=sys.stderr)
    seeds = {"home": [one.seed for one in known], "transferred": PLACES_SEED}
    season = factor_analysis.root_mean_squares(shown)
    return NuisanceSubspace(tuple(home), tuple(away), season, provenance(COMMAND, seeds))


def main(processes: int) -> int:
    """Write the subspace into the package."""
    found = learn(families(processes), processes)
    path = Path(str(files("igrow.trainer.diagnosis"))) / nuisance.FILE
    path.write_text(json.dumps(asdict(found)) + "\n", encoding="utf-8")
    print(f"wrote {len(found.home)} and {len(found.transferred)} directions to {path}")
    return 0
