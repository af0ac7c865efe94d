"""Learn what is usual between greenhouses: logs with nothing hidden, from seeds that no case has."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.logs import MISMATCH, SITE, reference
from igrow_core.greenhouse import Disturbances, GreenhouseParameters, generate_weather, recipe, simulate_many
from trainer.diagnosis import problem, runner, usual
from trainer.diagnosis.split import split_days

LOGS = 40
"""In each season."""
DAYS = 28
FIRST_SEED = 20_000


def main() -> int:
    """Write the directions into the package."""
    problems = []
    for number, (season, day) in enumerate(list(SEASONS.items())[:2]):
        model = reference(season).deployed
        start = np.datetime64(f"{day}T00:00:00")
        end = start + np.timedelta64(DAYS, "D")
        seed = FIRST_SEED + 10_000 * number
        logs = simulate_many(
            [GreenhouseParameters().varied(np.random.default_rng(seed + k), relative=MISMATCH) for k in range(LOGS)],
            [generate_weather(start, end, seed=seed + k) for k in range(LOGS)],
            recipe,
            start,
            end,
            count=LOGS,
            seed=seed,
            disturbances=Disturbances(degrees_of_freedom=4.0),
        )
        for log in logs:
            record, _ = runner.open_record(log.measured, SITE, model)
            days = split_days(record, SITE.longitude)
            problems.append(problem.prepare(record, days, model.prior, {}, SITE.longitude, model.known_misfit))
    path = Path(str(files("trainer.diagnosis"))) / usual.FILE
    path.write_text(json.dumps(usual.directions(problems)) + "\n", encoding="utf-8")
    print(f"wrote {usual.DIRECTIONS} directions from {len(problems)} logs to {path}")
    return 0
