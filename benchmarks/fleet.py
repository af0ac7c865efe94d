"""What a fleet costs: collecting a day of each of a thousand sites, a year of history behind one, bytes on the wire.

`python -m benchmarks.fleet [--sites N] [--seconds S]` seals one day of 23 points for each site, puts it into the
exchange, and runs `igrow-trainer fleet collect` as a user would; then one site day by day through a year; then a weekly
diagnosis. From these it projects what `--project N` sites cost on a cluster of `--cores` and `--memory`
(`projection.py`).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from benchmarks.projection import Cluster, Costs, report
from igrow.core.exchange import Entry, FolderPlace, Seal, pack_segment
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.edge.exchange.service import TransferRules
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.trainer.data import read_log
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect

DAY = 86_400
START = 20_500 * DAY


def day_of_log(day: int, step: float, seed: int) -> Telemetry:
    """Return one day of 25 points as sensors give it: slow courses, noise, a resolution."""
    generator = np.random.default_rng(seed)
    time = START + day * DAY + np.arange(0, DAY, step)
    columns = {}
    for name in [
        one for one in QUANTITIES if QUANTITIES[one].kind.value in ("weather", "climate", "setpoint", "actuator")
    ]:
        quantity = QUANTITIES[name]
        middle, half = (quantity.low + quantity.high) / 2.0, (quantity.high - quantity.low) / 8.0
        course = middle + half * np.sin(2 * np.pi * (time % DAY) / DAY + len(name))
        resolution = 10.0 ** np.floor(np.log10(half) - 1.5)
        if quantity.kind.value == "setpoint":
            held = max(1, int(21_600 / step))
            values = np.round(course[::held], 1).repeat(held)[: len(time)]
        else:
            # A sensor's noise is about as large as the step in which it is read.
            values = course + resolution * generator.normal(size=len(time))
        columns[name] = np.round(values / resolution) * resolution
    return Telemetry(time.astype("datetime64[s]"), columns)


def seal_day(site: str, day: int, previous: str, step: float, seed: int) -> tuple[str, bytes, str]:
    """Return name, content and digest of one day's segment, with the records that a day brings."""
    rows = day_of_log(day, step, seed)
    events = [
        {"sequence": 300 * day + n, "category": "write", "time": START + day * DAY + 288 * n, "requested": 18.123,
         "point": "heating_setpoint", "applied": 18.1, "source": "plan", "reason": "", "outcome": "confirmed"}
        for n in range(1, 300)
    ]  # fmt: skip
    start = float(START + day * DAY)
    units = {name: QUANTITIES[name].unit for name in rows.columns}
    seal = Seal(
        site,
        "e" * 12,
        day + 1,
        previous,
        start,
        start + DAY,
        start + DAY,
        "0.1.0",
        units,
        0,
        "",
        0,
        "",
        300 * (day + 1),
    )
    name, data = pack_segment(seal, rows, events)
    return str(name), data, name.digest


@dataclass(frozen=True)
class Collected:
    """What collecting and showing one site of many takes: seconds of processor, MB."""

    collecting: float
    looking: float
    showing: float


def on_the_gateway(step: float) -> None:
    """Print how long a gateway's own log and its outbox reach back."""
    with tempfile.TemporaryDirectory() as text:
        sizes, limits = [], StoreLimits()
        for day in range(4):
            store, rows = SqliteStore(Path(text)), day_of_log(day, step, day)
            for number, moment in enumerate(rows.time.astype("int64")):
                values = {name: Value(float(rows[name][number]), Quality.GOOD, 0.0) for name in rows.columns}
                store.append(float(moment), values)
            store.close()
            sizes.append((Path(text) / "telemetry.db").stat().st_size)
    grows = (sizes[-1] - sizes[0]) / (len(sizes) - 1)
    sent = len(seal_day("greenhouse", 0, "", step, 0)[1])
    print(f"in the gateway's own log              {grows / 1e6:8.3f} MB a day: "
          f"{limits.telemetry_bytes / 2**20:.0f} MB hold {limits.telemetry_bytes / grows:.0f} days")  # fmt: skip
    budget = TransferRules().budget
    print(f"in the outbox, while offline          {sent / 1e6:8.3f} MB a day: "
          f"{budget / 2**20:.0f} MB hold {budget / sent:.0f} days")  # fmt: skip


def collect_fleet(sites: int, step: float) -> Collected:
    """Collect a day of each site as a user would, once more where nothing is there, and write the page."""
    with tempfile.TemporaryDirectory() as text:
        root = Path(text)
        fleet = root / "fleet"
        (fleet / "sites").mkdir(parents=True)
        (fleet / "fleet.yaml").write_text("exchange: ../exchange\n")
        sent = 0
        place = FolderPlace(root / "exchange")
        for number in range(sites):
            site = f"greenhouse-{number:05}"
            (fleet / "sites" / f"{site}.yaml").write_text(f"name: {site}\nlatitude: 52\nlongitude: 4.5\n")
            name, data, _ = seal_day(site, 0, "", step, number % 20)
            place.put(f"{site}/segments/{name}", data)
            sent += len(data)
        command = [sys.executable, "-c", "import sys; from igrow.trainer.cli import main; sys.exit(main())"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(Path.cwd()), *sys.path]))}

        def run(*arguments: str) -> tuple[float, float, str]:
            """Run a command; returns seconds by the clock, seconds of processor, and what it printed."""
            began, used = time.perf_counter(), os.times()
            done = subprocess.run([*command, *arguments], env=environment, capture_output=True, text=True, check=False)
            wall, after = time.perf_counter() - began, os.times()
            assert done.returncode == 0, done.stderr[-2000:]
            cpu = after.children_user + after.children_system - used.children_user - used.children_system
            return wall, cpu, done.stdout

        wall, cpu, printed = run("fleet", "collect", str(fleet))
        kept = sum(path.stat().st_size for path in (fleet / "state").rglob("*") if path.is_file())
        peak = max(float(line.rsplit(",", 1)[1].split()[0]) for line in printed.splitlines() if " MB)" in line)
        print(f"sites                                 {sites}")
        print(
            f"a day on the wire                     {sent / sites / 1e6:8.3f} MB a site "
            f"({86_400 / step:.0f} rows of 23 points, 299 records)"
        )
        print(f"collecting, one process at a time     {wall / sites:8.3f} s a site ({cpu / sites:.3f} s of processor)")
        print(f"kept in the archive                   {kept / sites / 1e6:8.3f} MB a site and day")
        print(f"largest process                       {peak:8.0f} MB")
        _, looking, _ = run("fleet", "collect", str(fleet))
        print(f"a round that finds nothing            {'':8} {looking / sites:.3f} s of processor a site")
        wall, showing, _ = run("fleet", "status", str(fleet), "--page", str(root / "www"))
        pages = [one.stat().st_size / 1e6 for one in (root / "www").glob("*.html")]
        largest = f"{len(pages)} pages of {max(pages):.2f} MB at most"
        print(f"status and pages of all sites         {wall:8.1f} s, {largest}")
        return Collected(cpu / sites, looking / sites, showing / sites)


class CountingPlace(FolderPlace):
    """Counts what it is asked."""

    asked = 0

    def entries(self, folder: str) -> list[Entry]:
        self.asked += 1
        return super().entries(folder)

    def get(self, path: str, largest: int) -> bytes | None:
        self.asked += 1
        return super().get(path, largest)

    def put(self, path: str, content: bytes) -> None:
        self.asked += 1
        super().put(path, content)

    def delete(self, path: str) -> None:
        self.asked += 1
        super().delete(path)


def with_history(days: int, step: float) -> float:
    """Compare a day behind a week of history with a day behind a year; returns the requests of such a round."""
    with tempfile.TemporaryDirectory() as text:
        root, previous, seconds = Path(text), "", []
        place, archive = CountingPlace(root / "exchange"), Archive(root / "archive")
        for day in range(days):
            name, data, previous = seal_day("greenhouse", day, previous, step, day % 20)
            place.put(f"greenhouse/segments/{name}", data)
            place.asked = 0
            began = time.perf_counter()
            collect(place, "greenhouse", archive, datetime.fromtimestamp(START + (day + 1) * DAY, UTC))
            seconds.append(time.perf_counter() - began)
        week, year = float(np.median(seconds[1:8])), float(np.median(seconds[-7:]))
        ledger = (root / "archive" / "ledger" / "greenhouse.json").stat().st_size
        receipt = len(
            json.dumps(json.loads(next((root / "exchange" / "greenhouse" / "receipts").iterdir()).read_text()))
        )
        shutil.rmtree(root / "exchange")
    print(f"behind {days} days of history             {year / week:8.2f} times the time behind a week "
          f"(ledger {ledger / 1e3:.0f} kB, receipt {receipt} bytes, {place.asked} requests)")  # fmt: skip
    return float(place.asked)


def weekly_diagnosis(days: int) -> tuple[float, float]:
    """Diagnose one virtual greenhouse as the fleet does; returns seconds of processor and MB."""
    with tempfile.TemporaryDirectory() as text:
        root = Path(text)
        site = root / "greenhouse.yaml"
        site.write_text("name: greenhouse\nlatitude: 52\nlongitude: 4.5\n")
        command = [sys.executable, "-c", "import sys; from igrow.trainer.cli import main; sys.exit(main())"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(Path.cwd()), *sys.path]))}
        generate = ["generate", "--site", str(site), "--days", str(days), "--start", "2026-02-01", "--seed", "1"]
        subprocess.run([*command, *generate, "--out", str(root / "log")], env=environment, check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        archive = Archive(root / "state" / "archive")
        archive.add_telemetry("greenhouse", read_log(root / "log").telemetry)
        now = datetime(2026, 2, 1, tzinfo=UTC).timestamp() + days * DAY
        exchange = {"url": str(root / "exchange"), "base": str(root), "known_hosts": None, "identity": None}
        arguments = {"file": str(site), "state": str(root / "state"), "exchange": exchange, "keys": str(root / "keys"),
                     "now": now, "publish": False, "force": True, "days": 56}  # fmt: skip
        task = Task("greenhouse", "igrow.trainer.fleet.work:recalibrate_site", arguments, 3600.0, 8000, 0)
        (outcome,) = run_tasks([task])
        assert outcome.ending is Ending.DONE, outcome.note
    print(f"a diagnosis of {days} days               {outcome.processor:8.0f} s of processor, "
          f"{outcome.megabytes:.0f} MB (verdict {outcome.result['verdict']})")  # fmt: skip
    return outcome.processor, outcome.megabytes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=60.0, help="between two rows of the log (default 60)")
    parser.add_argument("--history", type=int, default=365, help="days")
    parser.add_argument("--diagnose", type=int, default=28, help="days of log to diagnose (default 28)")
    parser.add_argument("--project", type=int, default=100_000, help="sites of the projection (default 100000)")
    parser.add_argument("--cores", type=int, default=32, help="of the cluster (default 32)")
    parser.add_argument("--memory", type=float, default=128.0, help="of the cluster, GB (default 128)")
    parser.add_argument("--price", type=float, default=0.05, help="EUR a core and hour, assumed (default 0.05)")
    options = parser.parse_args()
    on_the_gateway(options.seconds)
    found = collect_fleet(options.sites, options.seconds)
    requests = with_history(options.history, 600.0)
    diagnosing, megabytes = weekly_diagnosis(options.diagnose)
    one = Costs(found.collecting, found.looking, requests, diagnosing, megabytes, found.showing)
    print("\n".join(report(one, Cluster(options.cores, options.memory, options.price), options.project)))


if __name__ == "__main__":
    main()
