"""Learn what a change must gain by time steps, and what it must take off unseen days: more than where there is none."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path

from benchmarks.diagnosis import null_gains, null_skills
from benchmarks.diagnosis.null_logs import (
    FALSE_CLAIMS,
    MORE_SEEDS,
    SEEDS,
    UNKNOWN_SEEDS,
    by_the_built_in_bundle,
    places,
    unchanged,
    unknown,
)
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.trainer.diagnosis.learned.null_gains import FILE, UNKNOWN_FILE, NullGains

COMMAND = "python -m benchmarks.diagnosis null-bounds"
BY_STEPS, BY_DAYS = FALSE_CLAIMS / 4, {"false_causes": FALSE_CLAIMS / 2, "false_patterns": FALSE_CLAIMS / 4}
"""What may be told falsely by time steps, and by unseen days alone: together no more than `FALSE_CLAIMS`."""


def main(processes: int) -> int:
    """Write the bounds into the package: skills first, since diagnoses go by them when the least gain is learned.

    These skills are of all places, and know the logs that are asked then.
    """
    seeds = SEEDS | MORE_SEEDS
    made, made_of_unknown = provenance(COMMAND, seeds), provenance(COMMAND, seeds | UNKNOWN_SEEDS)
    with Jobs("diagnosis null-bounds", processes) as jobs:
        logs = unchanged(jobs, places())
        for file, bounds in null_skills.learn(jobs, logs, made, **BY_DAYS).items():
            _write(file, bounds)
        _write(FILE, null_gains.learn(jobs, logs, made, BY_STEPS))
        logs = by_the_built_in_bundle(logs) + unknown(jobs)
        _write(UNKNOWN_FILE, null_gains.learn(jobs, logs, made_of_unknown, FALSE_CLAIMS))
    return 0


def _write(file: str, bounds: NullGains) -> None:
    path = Path(str(files("igrow.trainer.diagnosis"))) / file
    path.write_text(json.dumps(asdict(bounds), indent=1) + "\n", encoding="utf-8")
    print(f"least {bounds.least:g}; wrote {path}", flush=True)
