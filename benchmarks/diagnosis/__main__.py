"""Print the diagnosis benchmark: `python -m benchmarks.diagnosis [WHAT]`.

`scoring` (the default) draws 208 cases, simulates their logs and those that the models are calibrated on, diagnoses
each, and prints the table beside its bounds. `others` does the same with greenhouses that nothing was learned from,
each with a model calibrated on its own first weeks; `transferred` diagnoses the same logs with the built-in bundle.
`same` does the like with greenhouses that have drifted a little since their calibration, and asks what has changed in
them (`--foreign`: of another structure), and `false-claims` what is told of many in which nothing is missing;
`omission` takes terms out of the model before the calibration (with DATA: of the public logs) and asks the
calibration log for them; `real` diagnoses the public logs, `real-faults` the same with faults put into them.
`catalogue` hides every cause in turn in one greenhouse. `null-bounds` learns what a change must gain, and what it must
take off unseen days, from seeds that no case has; `separating` asks what tests of the plant bring, and `thresholds`
prints all rules. `summary` sets the figures of all pages of results side by side. All else is made afresh: an hour or
so on two cores, most of it for simulated weeks.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

from benchmarks.diagnosis import (
    catalogue,
    false_claims,
    null_bounds,
    omission,
    real,
    real_faults,
    rules,
    same,
    separating,
    summary,
)
from benchmarks.diagnosis.cases import SEASONS, draw
from benchmarks.diagnosis.greenhouses import of_seasons, others
from benchmarks.diagnosis.logs import built_in, reference, simulated_cases
from benchmarks.diagnosis.scoring import Outcome, judged, show, table
from benchmarks.jobs import Jobs

WHAT = (
    "scoring",
    "tuning",
    "others",
    "transferred",
    "thresholds",
    "same",
    "omission",
    "real",
    "real-faults",
    "null-bounds",
    "separating",
    "catalogue",
    "false-claims",
    "summary",
)
OTHER_GREENHOUSES = 8
SEASONS_USED = ("winter", "spring")


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("what", nargs="?", default="scoring", choices=WHAT)
    parser.add_argument("data", nargs="?", type=Path, help="folder of the public data sets, for `real`, `real-faults`")
    parser.add_argument("--cases", type=int, help="default: 208; of `same` 60, of `separating` 1 of each cause")
    parser.add_argument(
        "--greenhouses", type=int, help="of `same`, `false-claims`, `separating`: in a nursery (default: 6, 8, 2)"
    )
    parser.add_argument("--tuning", action="store_true", help="of `same`: greenhouses and seeds that rules are set on")
    parser.add_argument("--foreign", action="store_true", help="of `same`, `false-claims`: of another structure")
    parser.add_argument("--compartment", default="", help="of `real`: those whose name has this in it (default: all)")
    parser.add_argument("--withheld-only", action="store_true", help="of `real`: leave out built-in bundle and placebo")
    parser.add_argument("--beginning", type=int, help="of `real`: days of each log that are left out (default: 14)")
    parser.add_argument("--days", type=int, default=28)
    parser.add_argument(
        "--season",
        action="append",
        choices=tuple(SEASONS),
        help="default: winter and spring; all of `same`, `false-claims`",
    )
    parser.add_argument("--seed", type=int, help="of the first case; earlier tables had others")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write each case's outcome as a line of JSON")
    parser.add_argument("--figure", type=Path, help="of `catalogue`: SVG to write")
    options = parser.parse_args()
    if options.what == "real":
        return real.main(options.data, options.compartment, options.beginning, withheld_only=options.withheld_only)
    if options.what == "real-faults":
        return real_faults.main(options.data, options.compartment, options.processes)
    if options.what == "null-bounds":
        return null_bounds.main(options.processes)
    if options.what == "thresholds":
        return rules.show()
    if options.what == "summary":
        return summary.show()
    if options.what == "separating":
        return separating.main(options)
    if options.what == "same":
        return same.main(options)
    if options.what == "omission":
        return omission.main(options)
    if options.what == "catalogue":
        return catalogue.main(options)
    if options.what == "false-claims":
        return false_claims.main(options)
    count = options.cases or 208
    away = options.what in {"others", "transferred"}
    if away and options.season:
        parser.error("other greenhouses have seasons of their own: leave --season out")
    seasons = of_seasons()
    greenhouses = (
        others(OTHER_GREENHOUSES) if away else {name: seasons[name] for name in options.season or SEASONS_USED}
    )
    outcomes: list[Outcome] = []
    with Jobs(f"diagnosis {options.what}", options.processes) as jobs:
        print(f"calibrating on the reference logs of {', '.join(greenhouses)}", file=sys.stderr)
        references = {}
        for name, one in zip(greenhouses, jobs.each(reference, greenhouses.values()), strict=True):
            references[name] = one
            print(f"{len(references)} of {len(greenhouses)}: {name}", file=sys.stderr)
        units = {name: one.unit for name, one in references.items()}
        cases = draw("scoring" if away else options.what, count, units, options.seed)
        own = {name: [case for case in cases if case.greenhouse == name] for name in greenhouses}
        print(f"simulating {len(cases)} logs", file=sys.stderr)
        simulated = jobs.each(simulated_cases, [(one, own[name], options.days) for name, one in references.items()])
        if options.what == "transferred":
            references = {name: replace(one, model=built_in(one.greenhouse.site)) for name, one in references.items()}
        wanted = [
            (case, log, references[name])
            for name, logs in zip(greenhouses, simulated, strict=True)
            for case, log in zip(own[name], logs, strict=True)
        ]
        for number, outcome in enumerate(jobs.each(judged, wanted), 1):
            outcomes.append(outcome)
            case = outcome.case
            said = f"{case.name}: {case.causes} -> {outcome.verdict} {outcome.found}"
            print(f"{number} of {len(wanted)}: {said}", file=sys.stderr)
    if options.json:
        options.json.write_text("".join(json.dumps(asdict(one)) + "\n" for one in outcomes), encoding="utf-8")
    print(f"{len(outcomes)} cases, {options.days} days, {options.what}")
    print(show(table(outcomes)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
