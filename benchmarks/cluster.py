"""The same work by two processes of this machine, and by a local Ray of two workers one of which is killed.

`python -m benchmarks.cluster [--sites N] [--days N]` collects a sealed day of N sites both ways; with `--days` it
diagnoses that many days of N virtual greenhouses instead, which takes some seconds a site. It ends with 1 where a site
failed or the results differ.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from datetime import date
from pathlib import Path

import numpy as np

from benchmarks.fleet import DAY, START, seal_day
from benchmarks.processes import PeakMemory, kill_one
from igrow.core.exchange import FolderPlace
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, recipe, simulate_many
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.site_memory import site_folder

WORKERS = 2
SPREAD = 0.08
"""How much the greenhouses differ, relative."""


def arguments(root: Path, now: float) -> dict[str, object]:
    """Return what every task of a fleet is given."""
    exchange = {"url": str(root / "exchange"), "base": str(root), "known_hosts": None, "identity": None}
    return {"state": str(root / "state"), "exchange": exchange, "now": now}


def collecting(root: Path, names: Sequence[str]) -> list[Task]:
    """Leave a day of each site in the exchange; returns the tasks that collect it, a row a minute."""
    place, given = FolderPlace(root / "exchange"), arguments(root, float(START + 2 * DAY))
    for number, name in enumerate(names):
        segment, data, _ = seal_day(name, 0, "", 60.0, number)
        place.put(f"{name}/segments/{segment}", data)
    return [Task(name, "igrow.trainer.fleet.work:collect_site", {"site": name, **given}) for name in names]


def diagnosing(root: Path, names: Sequence[str], days: int) -> list[Task]:
    """Put logs of virtual greenhouses into the archive; returns the tasks that diagnose them."""
    start = np.datetime64(START, "s")
    rng, end = np.random.default_rng(0), start + np.timedelta64(days, "D")
    plants = [GreenhouseParameters().varied(rng, SPREAD) for _ in names]
    logs = simulate_many(plants, generate_weather(start, end, seed=1), recipe, start, end, count=len(names), seed=2)
    given = arguments(root, float(START + days * DAY)) | {
        "keys": str(root / "keys"), "publish": False, "force": True, "days": 56
    }  # fmt: skip
    tasks = []
    for name, plant, log in zip(names, plants, logs, strict=True):
        file = root / f"{name}.yaml"
        file.write_text(f"name: {name}\nlatitude: {plant.latitude}\nlongitude: {plant.longitude}\n")
        Archive(root / "state" / "archive").add_telemetry(name, log.measured)
        tasks.append(
            Task(name, "igrow.trainer.fleet.work:recalibrate_site", {"file": str(file), **given}, seconds=3600.0)
        )
    return tasks


def kept(root: Path, name: str) -> str:
    """Return a digest of all that stands for a site after its task: its log, its diagnosis if there is one."""
    telemetry = Archive(root / "state" / "archive").read(name, date(2026, 1, 1), date(2026, 12, 31)).telemetry
    digest = hashlib.sha256(telemetry.time.tobytes())
    for column in sorted(telemetry.columns):
        digest.update(column.encode() + telemetry[column].tobytes())
    diagnosis = site_folder(root / "state", name) / "diagnosis" / "diagnosis.json"
    return f"{len(telemetry)} {digest.hexdigest()} {diagnosis.read_text() if diagnosis.exists() else ''}"


def measure(what: str, root: Path, tasks: Sequence[Task], backend: Backend, killer: threading.Thread) -> dict[str, str]:
    """Do all tasks and print what that took; returns what stands for each site. Once one is done the killer starts."""
    done, failed, began = 0, 0, time.perf_counter()
    # Ray prints what it saw of the worker that is gone.
    with contextlib.redirect_stdout(sys.stderr), PeakMemory() as peak:
        for outcome in run_tasks(tasks, backend, workers=WORKERS):
            done += 1
            failed += outcome.ending is not Ending.DONE
            if done == 1:
                killer.start()
            print(f"{what}: {done} of {len(tasks)} {outcome.note}", file=sys.stderr, flush=True)
    seconds = time.perf_counter() - began
    assert not killer.is_alive(), "no worker was killed"
    print(f"{what:32} {seconds:8.1f} s {seconds / len(tasks):8.2f} s a site {peak.megabytes:8.0f} MB   {failed} failed")
    return {one.name: kept(root, one.name) for one in tasks} if not failed else {}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sites", type=int, default=50)
    parser.add_argument("--days", type=int, default=0, help="of log to diagnose (default 0: a day is collected)")
    options = parser.parse_args()
    names = [f"greenhouse-{number:02}" for number in range(options.sites)]
    what = f"a diagnosis of {options.days} days" if options.days else "a sealed day collected"
    print(f"{options.sites} virtual sites, of each {what}; largest memory of all processes together")
    found = []
    for title, backend in ((f"{WORKERS} processes", Backend.PROCESSES), (f"Ray, {WORKERS}, one killed", Backend.RAY)):
        target = (lambda: kill_one("ray::run_limited")) if backend is Backend.RAY else None
        with tempfile.TemporaryDirectory() as text:
            root = Path(text)
            tasks = diagnosing(root, names, options.days) if options.days else collecting(root, names)
            found.append(measure(title, root, tasks, backend, threading.Thread(target=target, daemon=True)))
    same = found[0] == found[1] and len(found[0]) == len(names)
    print(f"logs and diagnoses of both: {'the same to the last digit' if same else 'NOT the same'}")
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
