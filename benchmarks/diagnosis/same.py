"""The same greenhouse later: what has changed in it since its calibration.

Every greenhouse is calibrated on eight weeks of its own. Then its crop has grown on, each of its parameters has drifted
by a little, and in some cases its cover was cleaned or its disturbances are others: nothing of that is a finding.
Greenhouses stand in nurseries, one a season, and have seeds that nothing was learned or tuned on.
"""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict

from benchmarks.diagnosis import figures
from benchmarks.diagnosis.cases import SEASONS, Case, draw
from benchmarks.diagnosis.figures import Row
from benchmarks.diagnosis.logs import Reference
from benchmarks.diagnosis.makers import FOREIGN, OWN
from benchmarks.diagnosis.nurseries import calibrated, calibration_logs, later_logs, nursery
from benchmarks.diagnosis.scoring import Outcome, is_first, judged
from benchmarks.jobs import Jobs
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis.learned.null_gains import read_null_gains

CASES, DAYS = 60, 28
SEEDS = {"tuning": 200_000, "scoring": 900_000}
"""Of the first nursery; each season's are ten thousand on."""
FOREIGN_SEEDS = {"tuning": 700_000, "scoring": 800_000}
"""The same of greenhouses of another structure."""
GREENHOUSES = 6
"""In a nursery."""
GROUPS = (
    ("nothing", 0.0, 0.13), ("noise", 0.0, 0.06), ("clean", 0.0, 0.06), ("single", 3.0, 0.1), ("single", 1.0, 0.25),
    ("single", 0.3, 0.12), ("onset", 1.5, 0.1), ("pair", 1.5, 0.06), ("outside", 3.0, 0.06), ("outside", 1.0, 0.06),
    ("parameter", 0.0, 0.2),
)  # fmt: skip
"""Group, ENR and share of the cases."""


def table(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return all figures."""
    return [
        *figures.false_claims(outcomes),
        *figures.names(outcomes),
        *figures.changed_parameters(outcomes),
        *figures.oracle(outcomes, read_null_gains()),
        *figures.estimates(outcomes),
    ]


def prepared(job: tuple[str, str, int, int, int, bool]) -> list[tuple[Case, Telemetry, Reference]]:
    """Simulate and calibrate the nursery of a season; return its cases, their logs, and their greenhouses."""
    kind, season, greenhouses, count, days, foreign = job
    seeds, maker = (FOREIGN_SEEDS, FOREIGN) if foreign else (SEEDS, OWN)
    first = seeds[kind] + 10_000 * list(SEASONS).index(season)
    known = nursery(season, greenhouses, first, maker)
    references: dict[str, Reference] = {}
    for own_log in zip(known.greenhouses, calibration_logs(known), strict=True):
        one = calibrated(own_log)
        references[one.greenhouse.site.name] = one
        print(f"{season}: {len(references)} of {greenhouses} calibrated", file=sys.stderr, flush=True)
    cases = draw(kind, first, count, {name: one.unit for name, one in references.items()}, GROUPS)
    own = [[case for case in cases if case.greenhouse == name] for name in references]
    logs = later_logs(list(references.values()), own, days, maker)
    print(f"{season}: {len(cases)} logs", file=sys.stderr, flush=True)
    return [
        (case, log, one)
        for one, mine, seen in zip(references.values(), own, logs, strict=True)
        for case, log in zip(mine, seen, strict=True)
    ]


def main(options: Namespace) -> int:
    """Print the table."""
    kind = "tuning" if options.tuning else "scoring"
    seasons = options.season or list(SEASONS)
    greenhouses, count = options.greenhouses or GREENHOUSES, (options.cases or CASES) // len(seasons)
    outcomes: list[Outcome] = []
    with Jobs("diagnosis foreign" if options.foreign else "diagnosis same", options.processes) as jobs:
        wanted = [(kind, season, greenhouses, count, options.days, options.foreign) for season in seasons]
        cases = [case for own in jobs.each(prepared, wanted) for case in own]
        for number, one in enumerate(jobs.each(judged, cases), 1):
            outcomes.append(one)
            case = one.case
            said = f"{case.name} in {case.greenhouse} {case.causes} {case.size:g} -> {one.verdict} {one.found}"
            print(f"{number} of {len(cases)}: {said}", file=sys.stderr, flush=True)
    if options.json:
        options.json.write_text("".join(json.dumps(asdict(one)) + "\n" for one in outcomes), encoding="utf-8")
    print(
        f"{len(outcomes)} logs of {greenhouses * len(seasons)} greenhouses ({', '.join(seasons)}), {options.days} days"
    )
    print(f"{'':64} {'figure':>8} {'cases':>6}  bound")
    for row in table(outcomes):
        print(f"{row.what:64} {row.value:8.2f} {row.cases:6}  {row.bound}")
    print()
    print("by season: false claims; right first at ENR 1")
    for season in seasons:
        mine = [one for one in outcomes if one.case.greenhouse.startswith(season)]
        nothing = figures.of(mine, *figures.NOTHING)
        false = sum(one.verdict != "nothing" for one in nothing)
        right = figures.share("", figures.of(mine, "single", size=1.0), is_first)
        print(f"  {season:8} {false} of {len(nothing)}; {right.value:.2f} of {right.cases}")
    return 0
