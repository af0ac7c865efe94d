"""Print the diagnosis benchmark: `python -m benchmarks.diagnosis [scoring|tuning|elsewhere|matched|usual|real DATA]`.

`scoring` (the default) draws 208 cases, simulates their logs and those that the models are calibrated on, diagnoses
each, and prints the table beside its bounds. `elsewhere` does the same with greenhouses that nothing was learned from
(take 52 cases or so). `matched` does the like with greenhouses of the simulator's own
structure. `usual` learns anew what is usual between greenhouses, from seeds that
no case has. Everything is made afresh: an hour or so on two cores.
"""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from benchmarks.diagnosis import matched, real, usual
from benchmarks.diagnosis.cases import SEASONS, Case, draw
from benchmarks.diagnosis.houses import elsewhere, of_seasons
from benchmarks.diagnosis.logs import Reference, reference, simulate_cases
from benchmarks.diagnosis.scoring import Outcome, judge, show, table
from igrow_core.telemetry import Telemetry

WHAT = ("scoring", "tuning", "elsewhere", "matched", "usual", "real")
HOUSES_ELSEWHERE = 8


def _judge(job: tuple[Case, Telemetry, Reference]) -> Outcome:
    return judge(*job)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("what", nargs="?", default="scoring", choices=WHAT)
    parser.add_argument("data", nargs="?", type=Path, help="folder of the public data sets, for `real`")
    parser.add_argument("--cases", type=int, default=208)
    parser.add_argument("--days", type=int, default=28)
    parser.add_argument("--season", action="append", choices=tuple(SEASONS), help="default: winter and spring")
    parser.add_argument("--seed", type=int, help="of the first case; earlier tables had others")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write each case's outcome as a line of JSON")
    options = parser.parse_args()
    if options.what == "real":
        return real.main(options.data)
    if options.what == "matched":
        return matched.main(options.processes)
    if options.what == "usual":
        return usual.main(options.processes)
    away = options.what == "elsewhere"
    houses = elsewhere(HOUSES_ELSEWHERE) if away else of_seasons()
    seasons = list(houses) if away else options.season or ["winter", "spring"]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.processes) as pool:
        print(f"calibrating on the reference logs of {', '.join(seasons)}", file=sys.stderr)
        references = {}
        for season, one in zip(seasons, pool.map(reference, [houses[season] for season in seasons]), strict=True):
            references[season] = one
            print(f"{len(references)} of {len(seasons)}: {season}", file=sys.stderr)
        units = {season: one.unit for season, one in references.items()}
        cases = draw("scoring" if away else options.what, options.cases, units, options.seed)
        own = {season: [case for case in cases if case.season == season] for season in seasons}
        print(f"simulating {len(cases)} logs", file=sys.stderr)
        simulated = pool.map(
            simulate_cases,
            [references[season] for season in seasons],
            own.values(),
            [options.days] * len(seasons),
        )
        jobs = [
            (case, log, references[season])
            for season, logs in zip(seasons, simulated, strict=True)
            for case, log in zip(own[season], logs, strict=True)
        ]
        for number, outcome in enumerate(pool.map(_judge, jobs), 1):
            outcomes.append(outcome)
            case = outcome.case
            said = f"{case.name}: {case.causes} -> {outcome.verdict} {outcome.found}"
            print(f"{number} of {len(jobs)}: {said}", file=sys.stderr)
    if options.json:
        options.json.write_text("".join(json.dumps(asdict(one)) + "\n" for one in outcomes), encoding="utf-8")
    print(f"{len(outcomes)} cases, {options.days} days, {options.what}")
    print(show(table(outcomes)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
