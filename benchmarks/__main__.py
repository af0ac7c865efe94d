"""`make bench`: every benchmark, one after the other; each compares side by side within its own run."""

from __future__ import annotations

import subprocess
import sys

BENCHMARKS = {
    "simulator": ["benchmarks.simulator"],
    "network": ["benchmarks.network"],
    "planner": ["benchmarks.planner"],
    "greenhouse": ["benchmarks.greenhouse", "speed"],
    "bus": ["benchmarks.bus"],
    "gateway": ["benchmarks.gateway"],
    "fleet": ["benchmarks.fleet"],
}


def main() -> int:
    """Run those named on the command line, or all; returns 1 if one failed."""
    wanted = sys.argv[1:] or list(BENCHMARKS)
    unknown = [name for name in wanted if name not in BENCHMARKS]
    if unknown:
        print(f"error: no benchmark {', '.join(unknown)}; there are {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    failed = False
    for name in wanted:
        print(f"\n== {name}", flush=True)
        failed |= subprocess.run([sys.executable, "-m", *BENCHMARKS[name]], check=False).returncode != 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
