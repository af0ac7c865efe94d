"""The gateway's footprint: resident memory with a bundle loaded and no plan running, and start to first cycle.

`python -m benchmarks.gateway [--bundle FOLDER] [--starts N]` starts the real daemon, as a process of its own,
against the virtual PLC over Modbus TCP. The bundle is opened as in service: the hindcast graph by a shadow
run or a live error, the planner's graphs in the planning process, which ends when idle.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from igrow.core.bundle import default_bundle_folder

ROOT = Path(__file__).resolve().parents[1]
MEMORY_GOAL, START_GOAL = 150.0, 3.0


class Site:
    """A virtual PLC and a daemon's configuration in a folder."""

    def __init__(self, folder: Path, *, pace: str, clock: str, interval: str, bundle: Path) -> None:
        self.folder = folder
        self.environment = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "MALLOC_ARENA_MAX": "2",
            "PYTHONPATH": str(ROOT),
        }
        register_map = ROOT / "config" / "register-maps" / "virtual-plc.yaml"
        command = [sys.executable, "-m", "igrow.edge.cli", "simulate-plc", "--map", str(register_map), "--port", "0"]
        self.plc = subprocess.Popen(
            [*command, "--pace", pace, "--days", "30"], stdout=subprocess.PIPE, env=self.environment
        )
        assert self.plc.stdout is not None
        port = self.plc.stdout.readline().decode().split(",")[0].rsplit(":", 1)[1]
        (folder / "map.yaml").write_text(register_map.read_text().replace("port: 5020", f"port: {port}"))
        self.configuration = folder / "daemon.yaml"
        self.configuration.write_text(
            f"site: {ROOT / 'config' / 'site.yaml'}\nregister_map: map.yaml\nstate: state\nexchange: exchange\n"
            f"bundle: {bundle}\ncycle:\n  interval: {interval}\n  clock: {clock}\nstatus:\n  port: 0\n"
        )

    def start(self) -> subprocess.Popen[bytes]:
        log = (self.folder / "daemon.log").open("ab")
        command = [sys.executable, "-m", "igrow.edge.cli", "run", str(self.configuration)]
        return subprocess.Popen(command, stdout=log, stderr=log, env=self.environment)

    def state(self) -> dict[str, object] | None:
        try:
            return dict(json.loads((self.folder / "state" / "status.json").read_text())["state"])
        except (OSError, ValueError):
            return None

    def close(self) -> None:
        self.plc.kill()
        self.plc.wait()


def memory_of(pid: int) -> tuple[float, float]:
    """Return resident and unshared memory in MB."""
    found = {}
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        key, value, *_ = line.split()
        found[key] = int(value) / 1024.0
    return found["Rss:"], found["Private_Clean:"] + found["Private_Dirty:"]


def children_of(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def processor_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def time_to_first_cycle(bundle: Path, starts: int) -> list[tuple[float, float]]:
    """Return the seconds, by the clock and of processor, from a start to the first cycle with a PLC that answers."""
    found = []
    with tempfile.TemporaryDirectory() as text:
        site = Site(Path(text), pace="realtime", clock="system", interval="1 s", bundle=bundle)
        try:
            for _ in range(starts + 1):
                status = Path(text) / "state" / "status.json"
                status.unlink(missing_ok=True)
                began = time.perf_counter()
                daemon = site.start()
                while (state := site.state()) is None or not state["link_ok"]:
                    if daemon.poll() is not None or time.perf_counter() - began > 60:
                        raise SystemExit((Path(text) / "daemon.log").read_text())
                    time.sleep(0.002)
                found.append((time.perf_counter() - began, processor_seconds(daemon.pid)))
                daemon.send_signal(signal.SIGTERM)
                daemon.wait(30)
        finally:
            site.close()
    return found[1:]  # the first compiles the programs and unpacks the bundle


def memory_in_service(bundle: Path, days: float) -> tuple[float, float, list[float], str]:
    """Return resident and unshared MB after some days of plant time, those of other processes, and the bundle."""
    with tempfile.TemporaryDirectory() as text:
        site = Site(Path(text), pace="lockstep=300", clock="lockstep", interval="5 min", bundle=bundle)
        daemon = site.start()
        try:
            until = time.monotonic() + 600
            while (state := site.state()) is None or state["cycle"] < days * 288:  # type: ignore[operator]
                if daemon.poll() is not None or time.monotonic() > until:
                    raise SystemExit((Path(text) / "daemon.log").read_text()[-3000:])
                time.sleep(0.5)
            # The plant stands still now, so nothing is asked of the daemon, and an idle planning process ends.
            site.plc.send_signal(signal.SIGSTOP)
            until = time.monotonic() + 60
            while children_of(daemon.pid) and time.monotonic() < until:
                time.sleep(0.5)
            others = [memory_of(child)[0] for child in children_of(daemon.pid)]
            resident, unshared = memory_of(daemon.pid)
            loaded = state["bundle"]
            assert isinstance(loaded, dict)
            return resident, unshared, others, str(loaded.get("name"))
        finally:
            site.plc.send_signal(signal.SIGCONT)
            daemon.kill()
            daemon.wait()
            site.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, default=default_bundle_folder())
    parser.add_argument("--starts", type=int, default=5, help="starts to time")
    parser.add_argument("--days", type=float, default=3.0, help="days of plant time before memory is read")
    options = parser.parse_args()
    timed = time_to_first_cycle(options.bundle, options.starts)
    starts = [wall for wall, _ in timed]
    print(
        f"start to first complete cycle   {statistics.median(starts):6.2f} s   "
        f"(median of {len(starts)}, {min(starts):.2f} to {max(starts):.2f}; of processor "
        f"{statistics.median(used for _, used in timed):.2f} s; goal at most {START_GOAL:g} s)"
    )
    resident, unshared, others, bundle = memory_in_service(options.bundle, options.days)
    print(
        f"resident memory, no plan        {resident:6.1f} MB  "
        f"(of it unshared {unshared:.1f}; bundle {bundle}; goal at most {MEMORY_GOAL:g} MB)"
    )
    if others:
        print(f"processes beside it             {', '.join(f'{mb:.1f} MB' for mb in others)}")


if __name__ == "__main__":
    main()
