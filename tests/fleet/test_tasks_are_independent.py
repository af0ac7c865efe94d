"""One task's error, crash, memory or time is its own; what was killed is done again; results depend on no backend."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.processes import below
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task, TaskOutcome

HERE = "tests.fleet.fleet_of_sites"


def task(name: str, function: str, arguments: dict[str, object], *, limit: float = 60.0, megabytes: int = 1500) -> Task:
    return Task(name, f"{HERE}:{function}", arguments, limit, megabytes, 2)


def outcomes(*tasks: Task, workers: int = 1) -> dict[str, TaskOutcome]:
    return {one.name: one for one in run_tasks(tasks, workers=workers)}


def test_failures_of_every_kind_leave_the_others_alone(tmp_path: Path) -> None:
    found = outcomes(
        task("error", "fail", {"sentence": "the sensor is upside down"}),
        task("fault", "divide", {}),
        task("memory", "eat_memory", {}, megabytes=700),
        task("late", "sleep", {"seconds": 600}, limit=10.0),
        task("killed", "end_by_force", {"marks": str(tmp_path / "killed"), "times": 99}),
        task("recovers", "end_by_force", {"marks": str(tmp_path / "recovers"), "times": 1}),
        task("good", "compute", {"seed": 1}),
    )
    endings = {name: one.ending for name, one in found.items()}
    assert endings == {
        "error": Ending.FAILED,
        "fault": Ending.FAILED,
        "memory": Ending.FAILED,
        "late": Ending.LATE,
        "killed": Ending.KILLED,
        "recovers": Ending.DONE,
        "good": Ending.DONE,
    }
    assert found["error"].note == "the sensor is upside down"
    assert "ZeroDivisionError" in found["fault"].note
    assert "more memory" in found["memory"].note
    assert "10 s, its limit" in found["late"].note
    assert (found["killed"].attempts, found["killed"].note[:30]) == (3, "its process ended (SIGKILL); o")
    assert found["recovers"].result == {"attempt": 2}


def digits(found: dict[str, TaskOutcome]) -> dict[str, object]:
    return {name: one.result for name, one in found.items()}


def test_two_workers_give_the_digits_of_one() -> None:
    tasks = [task(f"site-{seed}", "compute", {"seed": seed}) for seed in range(8)]
    assert digits(outcomes(*tasks, workers=2)) == digits(outcomes(*tasks))


ON_RAY = """
import json, sys, threading
from benchmarks.processes import kill_one
from tests.fleet.test_tasks_are_independent import HERE, task
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.runner import run_tasks
marks = sys.argv[1]
tasks = [task(f"site-{seed}", "compute", {"seed": seed, "marks": marks}) for seed in range(8)]
tasks += [task(f"slow-{number}", "sleep", {"seconds": 3}) for number in range(2)]

def kill_a_worker():
    kill_one("ray::run_limited")
    print("killed", file=sys.stderr)

threading.Thread(target=kill_a_worker, daemon=True).start()
print(json.dumps({one.name: [one.ending.value, one.result] for one in run_tasks(tasks, Backend.RAY, workers=2)}))
"""


@pytest.mark.slow
def test_a_local_ray_of_two_workers_gives_the_same_digits_when_one_is_killed(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ON_RAY, str(tmp_path / "marks")],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "killed" in done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    tasks = [task(f"site-{seed}", "compute", {"seed": seed}) for seed in range(8)]
    expected = digits(outcomes(*tasks))
    assert {name: result for name, (_, result) in found.items() if name in expected} == expected
    assert all(ending == "done" for ending, _ in found.values())


def test_a_cluster_that_is_not_there_is_one_sentence() -> None:
    from igrow.core.errors import IgrowError

    with pytest.raises(IgrowError, match=r"no Ray cluster at 127\.0\.0\.1:1: "):
        list(run_tasks([task("one", "compute", {"seed": 1})], Backend.RAY, address="127.0.0.1:1"))


def test_a_process_that_was_just_forked_is_no_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """It shows its parent's command line, which may hold a script with the name that is looked for."""

    class Process:
        def __init__(self, *words: str) -> None:
            self.words = words

        def cmdline(self) -> list[str]:
            return list(self.words)

        def children(self, *, recursive: bool) -> list[Process]:
            return [Process("python", "-c", "kill_one('ray::run_limited')"), Process("ray::run_limited")]

    monkeypatch.setattr("psutil.Process", lambda: Process("python"))
    assert [one.cmdline() for one in below("ray::run_limited")] == [["ray::run_limited"]]


def test_a_backend_that_is_not_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    from igrow.core.errors import IgrowError

    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(IgrowError, match=r"install igrow\[ray\]"):
        list(run_tasks([task("one", "compute", {"seed": 1})], Backend.RAY))
