"""What is told of greenhouses in which nothing is missing, on seeds that nothing was learned or tuned on.

Each is calibrated on eight weeks of its own. Then its crop has grown on and every parameter has drifted by a little; in
some logs disturbances are others than at the calibration, or the cover was cleaned. Whatever is told is false.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Collection, Sequence

from scipy.stats import binomtest

from benchmarks.diagnosis.cases import SEASONS
from benchmarks.diagnosis.makers import FOREIGN, OWN
from benchmarks.diagnosis.null_logs import DAYS, unchanged
from benchmarks.diagnosis.nurseries import Nursery, nurseries
from benchmarks.diagnosis.scoring import Outcome, judged
from benchmarks.jobs import Jobs

SEEDS, FOREIGN_SEEDS = (260_000, 270_000), (280_000,)
"""Each of the first of its nurseries; each place's are a thousand on."""
GREENHOUSES = 8
"""Of every nursery."""
CONFIDENCE = 0.9
GROUPS = {"nothing": "nothing else", "noise": "disturbances twice as large", "clean": "a cleaned cover"}


def places(*, foreign: bool, greenhouses: int, seasons: Collection[str] = tuple(SEASONS)) -> list[Nursery]:
    """Draw the nurseries of some seasons."""
    seeds, maker = (FOREIGN_SEEDS, FOREIGN) if foreign else (SEEDS, OWN)
    return [one for first in seeds for one in nurseries(first, greenhouses, seasons, maker)]


def rows(outcomes: Sequence[Outcome]) -> list[tuple[str, int, int]]:
    """Return rows (of which logs, of how many something is told, how many)."""

    def of(what: str, chosen: list[Outcome]) -> tuple[str, int, int]:
        return what, sum(one.verdict != "nothing" for one in chosen), len(chosen)

    return [
        *(of(what, [one for one in outcomes if one.case.group == group]) for group, what in GROUPS.items()),
        *(of(season, [one for one in outcomes if one.case.name.startswith(season)]) for season in SEASONS),
        of("all", list(outcomes)),
    ]


def line(what: str, told: int, count: int) -> str:
    """Return a row with its share, and the exact interval of it (Clopper and Pearson 1934)."""
    if not count:
        return f"{what:32} {told:6} {count:6}"
    interval = binomtest(told, count).proportion_ci(CONFIDENCE)
    return f"{what:32} {told:6} {count:6} {told / count:8.3f}   {interval.low:.3f} to {interval.high:.3f}"


def main(options: Namespace) -> int:
    """Print the table, and what was told."""
    seasons = options.season or tuple(SEASONS)
    known = places(foreign=options.foreign, greenhouses=options.greenhouses or GREENHOUSES, seasons=seasons)
    outcomes: list[Outcome] = []
    with Jobs(f"diagnosis false-claims{' foreign' * options.foreign}", options.processes) as jobs:
        wanted = [(case, log, one) for one, case, log in unchanged(jobs, known)]
        for number, one in enumerate(jobs.each(judged, wanted), 1):
            outcomes.append(one)
            print(f"{number} of {len(wanted)}: {one.case.name} -> {one.verdict} {one.found}", file=sys.stderr)
    greenhouses = sum(len(one.greenhouses) for one in known)
    print(f"{len(outcomes)} logs of {greenhouses} greenhouses at {len(known)} places, {DAYS} days, nothing missing")
    print(f"{'':32} {'told':>6} {'of':>6} {'share':>8}   {CONFIDENCE:.0%} interval")
    print("\n".join(line(*row) for row in rows(outcomes)))
    print("\nwhat was told, and the error a day ahead on unseen days, recalibrated and with it:")
    for one in outcomes:
        if one.verdict != "nothing":
            told = f"{one.verdict} {', '.join(one.found)}"
            print(f"  {one.case.greenhouse:20} {one.case.group:8} {told:44} {one.recalibrated:.2f} {one.corrected:.2f}")
    return 0
