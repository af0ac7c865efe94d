"""What a new greenhouse gains by what others of its builder have shared: errors of its first weeks' model, later on.

`python -m benchmarks.population [--shared N] [--new N]` draws a builder whose greenhouses lie a fifth off the described
one, each a little in its own way, calibrates N of them on four weeks, and then new ones on a few days of log, once with
their description as the prior and once with what the others shared. Both are judged on the two weeks that follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.builder import QUANTITIES, SHARED_DAYS, START, asked_for, site_of
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, recipe, simulate_many
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import learned_from
from igrow.trainer.fit import evaluate
from igrow.trainer.fit.population import Population, learn_population

FIRST_DAYS = (8, 14)
JUDGED_DAYS = 14


@dataclass(frozen=True)
class Error:
    """Mean absolute errors a day ahead of one new greenhouse."""

    days: int
    described: dict[str, float]
    shared: dict[str, float]


def simulate(plants: Sequence[GreenhouseParameters], days: int, seed: int) -> list[Log]:
    """Return the logs of greenhouses under one sky."""
    end = START + np.timedelta64(days, "D")
    weather = generate_weather(START, end, seed=seed)
    seasons = simulate_many(plants, weather, recipe, START, end, count=len(plants), seed=seed)
    return [prepare_log(one.measured, site_of(plant)) for one, plant in zip(seasons, plants, strict=True)]


def judge(log: Log, days: int, population: Population | None) -> dict[str, float]:
    """Calibrate on the first days of a log; returns the errors a day ahead on its last two weeks."""
    end = START + np.timedelta64(days, "D")
    model = calibrate(log.select(None, end), population=population)
    later = log.select(log.telemetry.time[-1] - np.timedelta64(JUDGED_DAYS, "D")).record(model.alignment or 0.0)
    errors = evaluate(later, model.posterior.values, {}, ("24_h",))
    return {name: errors[name]["24_h"].mae for name in QUANTITIES}


def main() -> None:
    plants = asked_for(__doc__, shared=8, new=6, seed=44_000)
    shared = simulate(plants.shared, SHARED_DAYS, plants.seed + 1)
    population = learn_population([learned_from(calibrate(one)) for one in shared])
    found = []
    for log in simulate(plants.new, max(FIRST_DAYS) + JUDGED_DAYS, plants.seed + 2):
        found += [Error(days, judge(log, days, None), judge(log, days, population)) for days in FIRST_DAYS]
    print(f"{len(plants.new)} new greenhouses, {len(plants.shared)} that shared; error a day ahead, median (better in)")
    print(f"{'days of log':>12}" + "".join(f"{name:>34}" for name in QUANTITIES))
    for days in FIRST_DAYS:
        cells = []
        for name in QUANTITIES:
            pairs = [(one.described[name], one.shared[name]) for one in found if one.days == days]
            before, after = np.median(pairs, axis=0)
            cells.append(f"{before:.3g} -> {after:.3g} ({sum(b < a for a, b in pairs)} of {len(pairs)})")
        print(f"{days:>12}" + "".join(f"{cell:>34}" for cell in cells))


if __name__ == "__main__":
    main()
