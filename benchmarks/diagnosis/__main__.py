"""Print a benchmark of the diagnosis: `python -m benchmarks.diagnosis WHAT`.

`same` draws greenhouses that have drifted a little since their calibration, hides causes in them, and asks what has
changed (`--foreign`: of another structure); `false-claims` asks what is told of many in which nothing is missing, and
`catalogue` hides every cause in turn in one. `transferred` asks logs of greenhouses that no calibration has shown, by
the model of a neighbour and by the built-in bundle. `omission` takes terms out of the model before the calibration
(with DATA: of the public logs) and asks the calibration log for them; `real` diagnoses the public logs, `real-faults`
the same with faults put into them. `null-bounds` learns what a change must gain, and what it must take off unseen days,
from seeds that no case has; `separating` asks what tests of the plant bring, and `thresholds` prints all rules.
`summary` sets the figures of all pages of results side by side. All else is made afresh: an hour or so on two cores,
most of it for simulated weeks.
"""

from __future__ import annotations

import argparse
import sys
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
    transferred,
)
from benchmarks.diagnosis.cases import SEASONS

WHAT = (
    "same",
    "false-claims",
    "catalogue",
    "transferred",
    "omission",
    "real",
    "real-faults",
    "null-bounds",
    "separating",
    "thresholds",
    "summary",
)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.diagnosis", description=__doc__)
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("data", nargs="?", type=Path, help="folder of the public data sets, for `real`, `real-faults`")
    parser.add_argument(
        "--cases", type=int, help="of `same` (default: 60), `transferred` (72), `separating` (1 of each cause)"
    )
    parser.add_argument(
        "--greenhouses", type=int, help="of `same`, `false-claims`, `separating`: in a nursery (default: 6, 8, 2)"
    )
    parser.add_argument("--tuning", action="store_true", help="of `same`: greenhouses and seeds that rules are set on")
    parser.add_argument("--foreign", action="store_true", help="of `same`, `false-claims`: of another structure")
    parser.add_argument("--compartment", default="", help="of `real`: those whose name has this in it (default: all)")
    parser.add_argument("--withheld-only", action="store_true", help="of `real`: leave out built-in bundle and placebo")
    parser.add_argument("--beginning", type=int, help="of `real`: days of each log that are left out (default: 14)")
    parser.add_argument("--days", type=int, default=28, help="of each log of `same`, `separating` (default: 28)")
    parser.add_argument(
        "--season",
        action="append",
        choices=tuple(SEASONS),
        help="of `same`, `false-claims`, `omission`, `catalogue` (default: what its module names)",
    )
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
    return transferred.main(options)


if __name__ == "__main__":
    sys.exit(main())
