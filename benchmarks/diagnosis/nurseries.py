"""Nurseries: greenhouses at one place and in one season, each calibrated on its own eight weeks, then logged again.

All greenhouses of a nursery, and later all logs, are simulated as one batch, which costs little more than one alone.
The first greenhouse is the usual one, the others lie a quarter off in every parameter; every second one is unlit, and
every third has a crop that was planted when the calibration log begins.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.diagnosis.cases import CHANGES, SEASONS, Case, hidden
from benchmarks.diagnosis.greenhouses import OTHERS_SPREAD, VirtualGreenhouse, site_of
from benchmarks.diagnosis.logs import REFERENCE_DAYS, Reference, disturbances, referenced
from benchmarks.diagnosis.makers import OWN, Batch, Maker, Plant, State
from igrow.core.telemetry import Telemetry

DRIFT = 0.015
"""Relative deviation of every plant parameter from its value at the calibration."""
CLEANED = 1.06
"""What a cleaned cover lets through, over before."""
JITTER = 15
"""Days by which a season may begin earlier or later."""
PLACES = 2
"""Nurseries a season of `nurseries`."""


@dataclass(frozen=True)
class Nursery:
    """Greenhouses at one place."""

    season: str
    greenhouses: tuple[VirtualGreenhouse, ...]
    seed: int
    """Of the place; none of another nursery lies within a thousand."""
    maker: Maker = OWN

    @property
    def start(self) -> np.datetime64:
        """First day after the calibration logs."""
        return self.greenhouses[0].start


def nursery(season: str, count: int, first: int, maker: Maker = OWN) -> Nursery:
    """Draw a nursery.

    Args:
        season: its logs begin about the day of `SEASONS`.
        count: of greenhouses.
        first: seed of the place; no other nursery within a thousand.
        maker: whose greenhouses they are.
    """
    rng = np.random.default_rng(first)
    usual = maker.usual(float(rng.uniform(42.0, 60.0)))
    start = np.datetime64(f"{SEASONS[season]}T00:00:00") + np.timedelta64(int(rng.integers(-JITTER, JITTER + 1)), "D")
    found = []
    for number in range(count):
        seed = first + 1 + number
        plant = usual.varied(np.random.default_rng(seed), OTHERS_SPREAD if number else 0.0)
        if number % 2:
            plant = replace(plant, lamp_capacity=0.0)
        found.append(VirtualGreenhouse(site_of(f"{season}-{first}-{number}", plant), plant, start, seed))
    return Nursery(season, tuple(found), first, maker)


def nurseries(
    first: int, greenhouses: int, seasons: Collection[str] = tuple(SEASONS), maker: Maker = OWN
) -> list[Nursery]:
    """Draw the nurseries of some seasons, two of each; each is the same whichever others are asked for.

    Args:
        first: seed of the first of all seasons; each place's is a thousand on.
        greenhouses: of every nursery.
        seasons: of `SEASONS`.
        maker: whose greenhouses they are.
    """
    every = [season for season in SEASONS for _ in range(PLACES)]
    return [
        nursery(season, greenhouses, first + 1000 * number, maker)
        for number, season in enumerate(every)
        if season in seasons
    ]


def calibration_logs(known: Nursery) -> list[tuple[Telemetry, State]]:
    """Simulate the weeks before, with nothing hidden: of every greenhouse the log, and the state at its end."""
    greenhouses = known.greenhouses
    start = known.start - np.timedelta64(REFERENCE_DAYS, "D")
    plants = [one.plant for one in greenhouses]
    weather = [one.weather(start, known.start, one.seed) for one in greenhouses]
    begun = known.maker.begun(plants, np.arange(len(plants)) % 3 == 2)
    return known.maker.run(Batch(plants, weather, start, known.start, begun, greenhouses[0].seed))


def calibrated(job: tuple[VirtualGreenhouse, tuple[Telemetry, State]]) -> Reference:
    """Return a greenhouse calibrated on its log."""
    greenhouse, (log, state) = job
    return referenced(greenhouse, log, state)


def later_logs(
    known: Sequence[Reference], cases: Sequence[Sequence[Case]], days: int, maker: Maker = OWN
) -> list[list[Telemetry]]:
    """Simulate all cases of a nursery as one batch: its greenhouses themselves, some time after their calibration.

    Args:
        known: the greenhouses.
        cases: of each of them.
        days: of a log.
        maker: whose greenhouses they are.
    """
    pairs = [(one, case) for one, own in zip(known, cases, strict=True) for case in own]
    if not pairs:
        return [[] for _ in known]
    start = known[0].greenhouse.start
    end = start + np.timedelta64(days, "D")
    batch = Batch(
        [later(one.greenhouse, case) for one, case in pairs],
        [one.greenhouse.weather(start, end, case.seed) for one, case in pairs],
        start,
        end,
        [one.state for one, _ in pairs],
        pairs[0][1].seed,
        [hidden(case, one.unit, start) for one, case in pairs],
        [disturbances(case) for _, case in pairs],
    )
    logs = iter(maker.run(batch))
    return [[next(logs)[0] for _ in own] for own in cases]


def later(greenhouse: VirtualGreenhouse, case: Case) -> Plant:
    """Return the greenhouse as it is when the log of a case is taken."""
    plant = greenhouse.plant.varied(np.random.default_rng(case.seed), relative=DRIFT)
    if case.changed:
        share, _ = CHANGES[case.changed]
        return replace(plant, **{case.changed: share * getattr(plant, case.changed)})
    if case.group != "clean":
        return plant
    return replace(plant, cover_transmission=plant.cover_transmission * CLEANED)
