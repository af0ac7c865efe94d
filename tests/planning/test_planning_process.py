"""A plan that hangs, crashes or grows costs the daemon nothing, and the next one is made."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.planning import PlanningProcess, ProcessLimits
from igrow.edge.ports import PlanRequest

LOG = Telemetry(np.array(["2026-03-14"], dtype="datetime64[s]"), {"air_temperature": np.array([20.0])})


def request(seed: int = 0) -> PlanRequest:
    return PlanRequest(1.8e9, 3600.0, LOG, {"heating_setpoint": (18.0, 17.0)}, Path("bundle"), seed=seed)


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    made: list[PlanningProcess] = []

    def make(function: str, **limits: float) -> PlanningProcess:
        site = Site(name="demo", latitude=52.0, longitude=4.3)
        process = PlanningProcess(
            site,
            ProcessLimits(**{"timeout_seconds": 20.0, "memory_bytes": 2**28, **limits}),  # type: ignore[arg-type]
            planner=("plan_functions", function),
        )
        made.append(process)
        return process

    yield make
    for process in made:
        process.close()


async def test_a_plan_comes_back_without_blocking_the_caller(planner) -> None:
    service = planner("good")
    began = time.perf_counter()
    service.request(request())
    # Nothing of the process's start may be waited for here; its imports alone take longer than this.
    assert service.busy
    assert service.latest() is None
    assert time.perf_counter() - began < 5.0
    await service.wait(20.0)
    plan = service.latest()
    assert plan is not None
    assert plan.setpoints == {"heating_setpoint": (19.0, 18.0)}
    assert service.health == ""


async def test_one_process_serves_several_plans_and_ends_when_idle(planner) -> None:
    service = planner("good", idle_seconds=0.5)
    makers = []
    for _ in range(2):
        service.request(request())
        await service.wait(20.0)
        makers.append(service.latest().bundle)
    assert makers[0] == makers[1]
    pid = int(makers[0].split()[1])
    for _ in range(100):
        if service._process.poll() is not None:
            break
        await asyncio.sleep(0.1)
    assert service._process.poll() == 0
    service.request(request())
    await service.wait(20.0)
    assert service.health == ""
    assert int(service.latest().bundle.split()[1]) != pid


@pytest.mark.parametrize(
    ("function", "limits", "problem"),
    [
        ("hang_once", {"timeout_seconds": 2.0}, "took too long"),
        ("crash_once", {}, "it ended (signal 11)"),
        ("grow_once", {}, "more than 256 MiB"),
    ],
)
async def test_a_plan_that_goes_wrong_is_reported_and_the_next_is_made(planner, function, limits, problem) -> None:
    service = planner(function, **limits)
    service.request(request(seed=0))
    await service.wait(30.0)
    assert problem in service.health
    assert service.latest() is None
    service.request(request(seed=1))
    await service.wait(30.0)
    assert service.health == ""
    assert service.latest() is not None


@pytest.mark.parametrize(
    ("function", "problem"), [("refuse", "holds no wind_speed"), ("fail", "ZeroDivisionError: a fault of ours")]
)
async def test_the_reason_for_having_no_plan_is_one_line(planner, function: str, problem: str) -> None:
    service = planner(function)
    service.request(request())
    await service.wait(20.0)
    assert problem in service.health
    assert "\n" not in service.health


async def test_a_request_during_a_plan_is_passed_over(planner) -> None:
    service = planner("slow")
    service.request(request())
    service.request(PlanRequest(9.9e9, 3600.0, LOG, {"heating_setpoint": (1.0,)}, Path("bundle")))
    await service.wait(20.0)
    assert service.latest().start == 1.8e9


def test_closing_ends_a_hanging_process(planner) -> None:
    service = planner("hang_once", timeout_seconds=60.0)
    service.request(request())
    while service._process is None:
        time.sleep(0.01)
    process = service._process
    service.close()
    assert process.poll() is not None


def test_the_process_ends_with_a_daemon_that_was_killed(tmp_path: Path) -> None:
    script = tmp_path / "daemon.py"
    script.write_text(
        "import sys, time\n"
        f"sys.path[:0] = [{str(Path(__file__).parent)!r}, {str(Path.cwd())!r}]\n"
        "import test_planning_process as t\n"
        "from igrow.edge.planning import PlanningProcess\n"
        "from igrow.core.site import Site\n"
        "site = Site(name='demo', latitude=52.0, longitude=4.3)\n"
        "p = PlanningProcess(site, planner=('plan_functions', 'hang_once'))\n"
        "p.request(t.request())\n"
        "while p._process is None: time.sleep(0.01)\n"
        "time.sleep(1.0)\n"
        "print(p._process.pid, flush=True)\n"
        "time.sleep(60)\n"
    )
    daemon = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE)
    pid = int(daemon.stdout.readline())
    assert Path(f"/proc/{pid}").exists()
    daemon.kill()
    daemon.communicate()
    for _ in range(100):
        if not _is_running(pid):
            break
        time.sleep(0.1)
    assert not _is_running(pid)


def _is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
