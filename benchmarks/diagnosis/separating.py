"""What separating tests bring: the gain of a true cause in the same log with and without nights of tests.

The greenhouses of a nursery are calibrated on eight weeks; then each has one cause of ENR 1, and every log is simulated
once without a test and once for each test of the catalogue, run every second day: the same plant, weather and noise.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.diagnosis.cases import Case, hidden
from benchmarks.diagnosis.logs import Reference, disturbances
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later, nursery
from benchmarks.diagnosis.scoring import expected_gains
from igrow.core.greenhouse import recipe, simulate_many
from igrow.core.greenhouse.season import Schedule, Season
from igrow.core.greenhouse.tomato import Crop
from igrow.core.separating_tests import SEPARATING_TESTS, SeparatingTest
from igrow.core.sun import solar_hour
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.search import scan
from igrow.trainer.diagnosis.search.change import net_gain
from igrow.trainer.diagnosis.search.rounds import search_of

SEED = 410_000
GREENHOUSES = 2
CAUSES = ("vent_backlash", "co2_offset", "humidity_offset")
BEGINS = {"night": 22.0, "day": 11.0}
"""Local solar hour at which a test begins."""


@dataclass(frozen=True)
class Trial:
    """One log."""

    known: Reference
    cause: str
    case: Case
    test: SeparatingTest | None


@dataclass(frozen=True)
class Gain:
    """What the log of a trial tells of its cause, in nats."""

    expected: float
    """To be expected of it on this log, were the model right but for it."""
    own: float
    """Of the cause itself, beyond what it gained where nothing had changed."""
    others: float
    """The same of the best other effect."""


def trials(known: Sequence[Reference], count: int) -> list[Trial]:
    """Return every cause in every greenhouse, `count` times each, without a test and with each one."""
    found = []
    for position, one in enumerate(known):
        for number, cause in enumerate(CAUSES):
            for again in range(count):
                seed = SEED + 5000 + 1000 * position + 100 * number + again
                case = Case(
                    f"{cause}-{again}", "single", one.greenhouse.site.name, seed, (cause,), 1.0, ((1.0, 0.0, 0.0),)
                )
                found += [Trial(one, cause, case, test) for test in (None, *SEPARATING_TESTS.values())]
    return found


def schedule(chosen: Sequence[Trial]) -> Schedule:
    """Return the recipe, and for each log what its test asks for on every second day."""

    def at(time: np.datetime64) -> dict[str, np.ndarray]:
        values = {name: np.full(len(chosen), value) for name, value in recipe(time).items()}
        values["vent_lee"] = np.full(len(chosen), np.nan)
        asked = {name: asked_for(test, time) for name, test in SEPARATING_TESTS.items()}
        for column, one in enumerate(chosen):
            for name, value in asked[one.test.name].items() if one.test is not None else ():
                values[name][column] = value
        return values

    return at


def asked_for(test: SeparatingTest, time: np.datetime64) -> Mapping[str, float]:
    """Return what a test asks for at a time; it begins at the same hour of every second day."""
    minutes = 60.0 * ((float(solar_hour(time, 52.0, 4.53)) - BEGINS[test.when]) % 24.0)
    began = time - np.timedelta64(round(60 * minutes), "s")
    return (test.at(minutes) or {}) if began.astype("datetime64[D]").astype(int) % 2 == 0 else {}


def simulated(chosen: Sequence[Trial], days: int) -> list[Season]:
    """Return the season of each trial, all as one batch."""
    start = chosen[0].known.greenhouse.start
    end = start + np.timedelta64(days, "D")
    crops = [one.known.state for one in chosen]
    return simulate_many(
        [later(one.known.greenhouse, one.case) for one in chosen],
        [one.known.greenhouse.weather(start, end, one.case.seed) for one in chosen],
        schedule(chosen),
        start,
        end,
        count=len(chosen),
        seed=SEED,
        effects=[hidden(one.case, one.known.unit, start) for one in chosen],
        disturbances=[disturbances(one.case) for one in chosen],
        crop=Crop(*(np.concatenate(parts, axis=-1) for parts in zip(*crops, strict=True))),
    )


def gain(one: Trial, season: Season) -> Gain:
    """Return what a log tells of its cause."""
    site, model = one.known.greenhouse.site, one.known.model
    days = log_days(prepare_log(season.measured, site), model)
    design = search_of(days, site, knowledge_of(model, site, DEFAULT), frozenset(), DEFAULT).design(())
    truth = {effect.name: effect for effect in hidden(one.case, one.known.unit, one.known.greenhouse.start)}
    expected, _ = expected_gains(design, one.case, truth)
    null = linear.fit(design.grams, design.null_model())
    scored = scan.score_candidates(design, null, [None], np.random.default_rng(1))
    gains = {True: 0.0, False: 0.0}
    for candidate in scored:
        own = candidate.effect == one.cause
        gains[own] = max(gains[own], net_gain(design, candidate))
    return Gain(expected or 0.0, gains[True], gains[False])


def main(options: Namespace) -> int:
    """Print the gain of each cause without and with each test, and what a test costs."""
    known = nursery((options.season or ["spring"])[0], options.greenhouses or GREENHOUSES, SEED)
    print(f"calibrating {len(known.greenhouses)} greenhouses", file=sys.stderr)
    references = [calibrated(job) for job in zip(known.greenhouses, calibration_logs(known), strict=True)]
    return show(references, options.cases or 1, options.days)


def show(references: Sequence[Reference], count: int, days: int) -> int:
    """Simulate and print; `count` logs of each cause in each greenhouse."""
    chosen = trials(references, count)
    print(f"simulating {len(chosen)} logs of {days} days", file=sys.stderr, flush=True)
    seasons = simulated(chosen, days)
    found: list[Gain] = []
    for one, season in zip(chosen, seasons, strict=True):
        found.append(gain(one, season))
        test = one.test.name if one.test else "-"
        print(f"{one.case.greenhouse} {one.cause} {test}: {found[-1]}", file=sys.stderr, flush=True)
    print(f"{len(references)} greenhouses, {count} logs of {days} days for each cause of ENR 1, tests every second day")
    print("median gain in nats: to be expected of the true cause; of the true cause; of the best other")
    print(f"{'':18}" + "".join(f"{name:>26}" for name in ("no test", *SEPARATING_TESTS)))
    for cause in CAUSES:
        cells = []
        for name in (None, *SEPARATING_TESTS):
            mine = [
                (one.expected, one.own, one.others)
                for one, trial in zip(found, chosen, strict=True)
                if trial.cause == cause and (trial.test.name if trial.test else None) == name
            ]
            cells.append(" ".join(f"{value:8.1f}" for value in np.median(mine, axis=0)))
        print(f"{cause:18}" + "".join(f"{cell:>26}" for cell in cells))
    print("what one test takes, mean: heat in MJ m-2, CO2 in kg m-2")
    for name in SEPARATING_TESTS:
        pairs = [
            (season, next(s for t, s in zip(chosen, seasons, strict=True) if t.case is trial.case and t.test is None))
            for trial, season in zip(chosen, seasons, strict=True)
            if trial.test is not None and trial.test.name == name
        ]
        runs = days / 2.0
        heat, co2 = (
            float(np.mean([(season.total(what) - before.total(what)) / runs for season, before in pairs]))
            for what in ("heat", "co2")
        )
        print(f"{name:18}{heat:8.3f}{co2:10.4f}")
    return 0
