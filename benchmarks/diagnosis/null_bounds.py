"""Learn what a change must gain by time steps, and what it must take off unseen days: more than where there is none."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path

from benchmarks.diagnosis import null_gains, null_skills
from benchmarks.diagnosis.null_logs import SEEDS, UNKNOWN_SEEDS, by_the_built_in_bundle, nurseries, unchanged, unknown
from benchmarks.jobs import Jobs
from benchmarks.provenance import provenance
from igrow.trainer.diagnosis.learned.null_gains import FILE, UNKNOWN_FILE, NullGains

COMMAND = "python -m benchmarks.diagnosis null-bounds"


def main(processes: int) -> int:
    """Write the bounds into the package: skills first, since diagnoses go by them when the least gain is learned."""
    with Jobs("diagnosis null-bounds", processes) as jobs:
        logs, made = unchanged(jobs, nurseries()), provenance(COMMAND, dict(SEEDS))
        for file, bounds in null_skills.learn(jobs, logs, made).items():
            _write(file, bounds)
        _write(FILE, null_gains.learn(jobs, logs, made))
        logs, made = by_the_built_in_bundle(logs) + unknown(jobs), provenance(COMMAND, SEEDS | UNKNOWN_SEEDS)
        _write(UNKNOWN_FILE, null_gains.learn(jobs, logs, made, null_skills.FALSE_CLAIMS))
    return 0


def _write(file: str, bounds: NullGains) -> None:
    path = Path(str(files("igrow.trainer.diagnosis"))) / file
    path.write_text(json.dumps(asdict(bounds), indent=1) + "\n", encoding="utf-8")
    print(f"least {bounds.least:g}; wrote {path}", flush=True)
