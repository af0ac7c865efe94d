"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.logs import MISMATCH, SITE, reference
from igrow_core.greenhouse import Disturbances, GreenhouseParameters, generate_weather, recipe, simulate_many
from trainer.diagnosis import problem, runner, usual
from trainer.diagnosis.problem import Problem
from trainer.diagnosis.split import split_days

LOGS = 30
"""In each season."""
DAYS = 28
FIRST_SEEDS = {"winter": 20_000, "spring": 30_000}


def problems(season: str) -> list[Problem]:
    """Return the prepared problems of a season's logs, each without usual directions of its own."""
    model = reference(season).deployed
    start = np.datetime64(f"{SEASONS[season]}T00:00:00")
    end = start + np.timedelta64(DAYS, "D")
    first = FIRST_SEEDS[season]
    logs = simulate_many(
        [GreenhouseParameters().varied(np.random.default_rng(first + k), relative=MISMATCH) for k in range(LOGS)],
        [generate_weather(start, end, seed=first + k) for k in range(LOGS)],
        recipe,
        start,
        end,
        count=LOGS,
        seed=first,
        disturbances=Disturbances(degrees_of_freedom=4.0),
    )
    found = []
    for log in logs:
        record, _ = runner.open_record(log.measured, SITE, model)
        days = split_days(record, SITE.longitude)
        found.append(problem.prepare(record, days, model.prior, {}, SITE.longitude, model.known_misfit))
    return found


def main() -> int:
    """Write the directions into the package."""
    with ProcessPoolExecutor(len(FIRST_SEEDS)) as pool:
        prepared = [one for part in pool.map(problems, FIRST_SEEDS) for one in part]
    path = Path(str(files("trainer.diagnosis"))) / usual.FILE
    path.write_text(json.dumps(usual.directions(prepared)) + "\n", encoding="utf-8")
    print(f"wrote {usual.DIRECTIONS} directions from {len(prepared)} logs to {path}")
    return 0
