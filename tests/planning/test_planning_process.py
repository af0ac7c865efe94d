"""A plan that hangs, crashes or grows costs the daemon nothing, and the next one is made."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.planning import GraphProcess, NotCalledError, PlanningProcess, ProcessError, ProcessLimits
from igrow.edge.ports import PlanRequest
from tests.patience import PATIENCE

LOG = Telemetry(np.array(["2026-03-14"], dtype="datetime64[s]"), {"air_temperature": np.array([20.0])})
FUNCTIONS = "tests.planning.plan_functions"


def request(seed: int = 0, log: Telemetry = LOG) -> PlanRequest:
    return PlanRequest(1.8e9, 3600.0, log, {"heating_setpoint": (18.0, 17.0)}, Path("bundle"), seed=seed)


@pytest.fixture
def planner():
    made: list[PlanningProcess] = []

    def make(function: str, seconds: float = PATIENCE, **limits: float) -> PlanningProcess:
        site = Site(name="demo", latitude=52.0, longitude=4.3)
        graphs = GraphProcess(ProcessLimits(**{"memory_bytes": 2**28, **limits}))  # type: ignore[arg-type]
        process = PlanningProcess(site, graphs, seconds=seconds, planner=f"{FUNCTIONS}:{function}")
        made.append(process)
        return process

    yield make
    for process in made:
        process.close()


async def test_a_plan_comes_back_without_blocking_the_caller(planner) -> None:
    service = planner("good")
    began = time.perf_counter()
    service.request(request)
    # Nothing of the process's start may be waited for here; its imports alone take longer than this.
    assert service.busy
    assert service.latest() is None
    assert time.perf_counter() - began < 5.0
    await service.wait(PATIENCE)
    plan = service.latest()
    assert plan is not None
    assert plan.setpoints == {"heating_setpoint": (19.0, 18.0)}
    assert service.health == ""


async def test_one_process_serves_several_plans_and_ends_when_idle(planner) -> None:
    service = planner("good", idle_seconds=2.0)
    makers = []
    for _ in range(2):
        service.request(request)
        await service.wait(PATIENCE)
        makers.append(service.latest().bundle)
    assert makers[0] == makers[1]
    pid = int(makers[0].split()[1])
    await until(lambda: service._graphs.pid is None)
    assert service._graphs._process.poll() == 0
    service.request(request)
    await service.wait(PATIENCE)
    assert service.health == ""
    assert int(service.latest().bundle.split()[1]) != pid


async def until(condition) -> None:
    async with asyncio.timeout(PATIENCE):
        while not condition():  # noqa: ASYNC110 - what is waited for happens in another process
            await asyncio.sleep(0.05)


@pytest.mark.parametrize(
    ("function", "limits", "problem"),
    [
        ("hang_once", {"seconds": 5.0}, "took too long"),
        ("crash_once", {}, "it ended (signal 11)"),
        ("grow_once", {}, "more than 256 MiB"),
    ],
)
async def test_a_plan_that_goes_wrong_is_reported_and_the_next_is_made(planner, function, limits, problem) -> None:
    service = planner(function, **limits)
    service.request(lambda: request(seed=0))
    await service.wait(PATIENCE)
    assert problem in service.health
    assert service.latest() is None
    # The next one starts a process of its own, for which a busy machine needs its time.
    service._seconds = PATIENCE
    service.request(lambda: request(seed=1))
    await service.wait(PATIENCE)
    assert service.health == ""
    assert service.latest() is not None


@pytest.mark.parametrize(
    ("function", "problem"), [("refuse", "holds no wind_speed"), ("fail", "ZeroDivisionError: a fault of ours")]
)
async def test_the_reason_for_having_no_plan_is_one_line(planner, function: str, problem: str) -> None:
    service = planner(function)
    service.request(request)
    await service.wait(PATIENCE)
    assert problem in service.health
    assert "\n" not in service.health


async def test_a_request_during_a_plan_is_passed_over(planner) -> None:
    service = planner("slow")
    service.request(request)
    service.request(lambda: PlanRequest(9.9e9, 3600.0, LOG, {"heating_setpoint": (1.0,)}, Path("bundle")))
    await service.wait(PATIENCE)
    assert service.latest().start == 1.8e9


async def test_a_log_that_cannot_be_read_delays_nobody_and_is_no_plan(planner) -> None:
    service = planner("good")
    answer = threading.Event()

    def from_a_disk_that_hangs() -> PlanRequest:
        answer.wait()
        raise IgrowError("the disk is gone")

    service.request(from_a_disk_that_hangs)
    assert service.busy
    answer.set()
    await service.wait(PATIENCE)
    assert "the disk is gone" in service.health


async def test_a_process_that_was_stopped_takes_no_request_and_is_replaced(planner, monkeypatch) -> None:
    """A large request does not fit into the pipe, so that one who only writes would wait for ever."""
    service = planner("good")
    service.request(request)
    await service.wait(PATIENCE)
    os.kill(service._graphs.pid, signal.SIGSTOP)
    seconds = np.arange(200_000).astype("datetime64[s]")
    large = Telemetry(seconds, {"air_temperature": np.zeros(len(seconds))})
    # Of the stopped process alone: one that has just been started may need longer on a busy machine.
    with monkeypatch.context() as patch:
        patch.setattr("igrow.edge.planning.graph_process.SEND_SECONDS", 2.0)
        service.request(lambda: request(log=large))
        await service.wait(PATIENCE)
    assert "took too long" in service.health
    service.request(request)
    await service.wait(PATIENCE)
    assert service.health == ""


def test_closing_ends_a_hanging_process(planner) -> None:
    service = planner("hang_once")
    service.request(request)
    while service._graphs.pid is None:
        time.sleep(0.01)
    process = service._graphs._process
    service.close()
    assert process.wait(PATIENCE) is not None


def test_a_call_under_way_when_the_daemon_stops_is_no_fault_of_what_was_called(planner) -> None:
    graphs = planner("hang_once")._graphs
    threading.Timer(1.0, graphs.close).start()
    with pytest.raises(NotCalledError):
        graphs.call(f"{FUNCTIONS}:hang_once", None, request(), seconds=PATIENCE)
    with pytest.raises(NotCalledError):
        graphs.call(f"{FUNCTIONS}:good", None, request(), seconds=PATIENCE)


def test_a_call_that_burns_processor_time_is_ended_by_the_kernel_though_the_daemon_sleeps(planner) -> None:
    """The daemon itself ends a call by the wall's clock; while it is stopped, its process must end by itself."""
    graphs = planner("good")._graphs
    with pytest.raises(ProcessError, match=f"signal {signal.SIGXCPU}"):
        graphs._ask = lambda call, seconds: GraphProcess._ask(graphs, (call[0], call[1], 1.0), seconds)
        graphs.call(f"{FUNCTIONS}:burn", seconds=PATIENCE)


def test_the_process_is_the_first_to_go_where_the_machine_has_no_memory_left(planner) -> None:
    graphs = planner("good")._graphs
    assert graphs.call(f"{FUNCTIONS}:oom_score", seconds=PATIENCE) == 1000


@pytest.mark.parametrize("when", ["in the middle of a call", "while its process starts"])
def test_the_process_ends_with_a_daemon_that_was_killed(tmp_path: Path, when: str) -> None:
    begun = tmp_path / "begun"
    script = tmp_path / "daemon.py"
    script.write_text(
        "import sys, threading, time\n"
        f"sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from igrow.edge.planning import GraphProcess\n"
        "graphs = GraphProcess()\n"
        f"call = lambda: graphs.call('{FUNCTIONS}:note_and_hang', {str(begun)!r}, seconds=600.0)\n"
        "threading.Thread(target=call, daemon=True).start()\n"
        "while graphs.pid is None: time.sleep(0.001)\n"
        "print(graphs.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    daemon = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE)
    assert daemon.stdout is not None
    pid = int(daemon.stdout.readline())
    if when == "in the middle of a call":
        wait_until(begun.exists)
    assert _is_running(pid)
    daemon.kill()
    daemon.communicate()
    wait_until(lambda: not _is_running(pid))


def wait_until(condition) -> None:
    """Wait for a condition; the limit only says when a test has failed."""
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


def _is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
