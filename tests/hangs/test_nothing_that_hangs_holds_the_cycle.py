"""Whatever touches a disk, a share, a graph or a network hangs in turn: cycles go on, and a stop leaves safe setpoints.

Each test hangs one collaborator while the daemon runs, waits for many more cycles and heartbeats, and stops the daemon
while it still hangs. That no call that may hang is made by the thread of the control cycle is noted besides.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import threading
from pathlib import Path

import pytest
from pymodbus.transport.serialtransport import SerialTransport

from igrow.core.whole_files import write_whole
from igrow.edge.exchange import ExchangeService
from igrow.edge.planning import GraphProcess, PlanningProcess
from igrow.edge.sources.override import Lease, write_leases
from igrow.edge.status.server import StatusServer
from igrow.edge.systemd_notify import SystemdNotifier
from tests.control.daemon_bench import hurry, plan_at_once, until
from tests.hangs.conftest import Bench
from tests.hangs.hanging_disk import HangingDisk
from tests.patience import PATIENCE
from tests.tiny_bundle import endless_graph, write_tiny_bundle

FUNCTIONS = "tests.hangs.hanging_functions"


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return what makes a disk of a folder that can hang; it answers again when the test is over."""
    made = []

    def make(name: str) -> HangingDisk:
        made.append(HangingDisk(monkeypatch, tmp_path / name))
        return made[-1]

    yield make
    for one in made:
        one.answer()


async def test_a_state_folder_that_hangs(bench: Bench, disk) -> None:
    """The log, the ledger, overrides, the status file and the bundles' state are all on it."""
    state = disk("state")
    async with bench.running() as daemon:
        await bench.controls()
        state.hang()
        bench.plant.table.values["air_temperature"] += 0.5
        await bench.goes_on()
        assert state.hung
        await until(lambda: any("the log: no answer for" in one for one in problems(daemon)), PATIENCE)
    assert state.held == []


async def test_a_state_folder_that_answers_again_has_lost_nothing(bench: Bench, disk) -> None:
    state = disk("state")
    async with bench.running() as daemon:
        await bench.controls()
        state.hang()
        daemon._journal.event("while_it_hung", number=1)
        await bench.goes_on()
        state.answer()
        await until(lambda: "while_it_hung" in bench.events(), PATIENCE)
        assert write_leases(bench.folder / "state" / "override.json", {"co2_setpoint": Lease(640.0, 3600.0)}) == ""
        await until(lambda: bench.plant.shows("co2_setpoint") == 640.0, PATIENCE)
        await until(lambda: not problems(daemon), PATIENCE)
    assert state.held == []
    assert {"started", "while_it_hung", "stopped"} <= set(bench.events())


async def test_a_state_folder_that_hangs_from_the_start(bench: Bench, disk) -> None:
    """What was set by hand before cannot be known: the heart beats, and all setpoints are left alone until it is."""
    state = disk("state")
    by_hand = {"heating_setpoint": 21.0, "co2_setpoint": 400.0}
    async with bench.running(stops_at=by_hand):
        await bench.controls()
        bench.plant.plc.set_by_hand("heating_setpoint", 21.0)
        await until(lambda: "changed_by_hand" in bench.events(), PATIENCE)
    state.hang()
    again = Bench(bench.folder)
    async with again.running(stops_at=by_hand) as daemon:
        for name, value in by_hand.items():
            again.plant.plc.set_by_hand(name, value)
        await again.goes_on()
        assert {alarm.name for alarm in daemon._journal.alarms.active} >= {"memory"}
        assert {name: again.plant.shows(name) for name in by_hand} == by_hand
        state.answer()
        await until(lambda: again.plant.shows("co2_setpoint") == 700.0, PATIENCE)
        await again.goes_on()
        assert again.plant.shows("heating_setpoint") == 21.0
    assert state.held == []


async def test_a_forecast_on_a_share_that_hangs(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("igrow.edge.planning_schedule.LEAST_HISTORY", 0.0)
    os.mkfifo(bench.folder / "forecast.csv")
    bench.add("planning: {forecast: forecast.csv, timeout: 1 h}\n")
    async with bench.running() as daemon:
        planner = PlanningProcess(
            daemon.configuration.site, daemon.services.graphs, planner=f"{FUNCTIONS}:wait_for_the_forecast"
        )
        await plan_at_once(daemon, planner, bench.folder)
        await until(lambda: planner.busy, PATIENCE)
        await bench.controls()
        await bench.goes_on()
        assert planner.busy


async def test_a_planning_process_that_was_stopped(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("igrow.edge.planning_schedule.LEAST_HISTORY", 0.0)
    async with bench.running() as daemon:
        graphs = GraphProcess()
        assert graphs.call(f"{FUNCTIONS}:nothing", seconds=PATIENCE) is None
        assert graphs.pid is not None
        os.kill(graphs.pid, signal.SIGSTOP)
        planner = PlanningProcess(daemon.configuration.site, graphs, planner=f"{FUNCTIONS}:nothing")
        await plan_at_once(daemon, planner, bench.folder)
        await until(lambda: planner.busy, PATIENCE)
        await bench.controls()
        await bench.goes_on()
        assert planner.busy


async def test_an_exchange_that_hangs(bench: Bench) -> None:
    """It is touched by a process of its own, the courier, which here stands still in the middle of its round."""
    bench.add("exchange: exchange\n")
    async with bench.running() as daemon:
        exchange = daemon.services.exchange
        assert isinstance(exchange, ExchangeService)
        await until(lambda: exchange._process is not None, PATIENCE)
        courier = exchange._process
        assert courier is not None
        os.kill(courier.pid, signal.SIGSTOP)
        await bench.controls()
        await bench.goes_on()
        assert exchange.busy
    with contextlib.suppress(ProcessLookupError):
        os.kill(courier.pid, signal.SIGKILL)


async def test_updates_whose_trust_lies_on_a_disk_that_hangs(bench: Bench) -> None:
    os.mkfifo(bench.folder / "root.json")
    bench.add("exchange: exchange\nupdates: {trusted_root: root.json}\n")
    async with bench.running() as daemon:
        await bench.controls()
        await until(lambda: daemon.services.updates.busy, PATIENCE)
        await bench.goes_on()
        assert daemon.services.updates.busy


async def test_a_bundle_on_a_disk_that_hangs(bench: Bench, disk) -> None:
    first = disk("first")
    first.hang()
    async with bench.running() as daemon:
        await bench.controls()
        await bench.goes_on()
        assert first.hung
        assert daemon.services.updates.active() is None
    assert first.held == []


async def test_a_bundle_whose_self_test_never_ends(bench: Bench) -> None:
    write_tiny_bundle(bench.folder / "endless", site="test-greenhouse", graph=endless_graph())
    bench.configuration.write_text(bench.configuration.read_text().replace("bundle: first", "bundle: endless"))
    async with bench.running() as daemon:
        await bench.controls()
        await until(lambda: daemon.services.graphs.pid is not None, PATIENCE)
        await bench.goes_on()
        assert daemon.services.updates.busy
    assert daemon.services.graphs.pid is None


async def test_visitors_of_the_status_page_who_say_nothing_and_read_nothing(bench: Bench) -> None:
    async with bench.running() as daemon:
        await bench.controls()
        status = daemon.services.status
        assert isinstance(status, StatusServer)
        visitors = [await asyncio.open_connection("127.0.0.1", status.port, limit=1) for _ in range(200)]
        for _, writer in visitors[:50]:
            assert isinstance(writer.transport, asyncio.Transport)
            writer.transport.pause_reading()
            writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" * 100)
        await bench.goes_on()
        handles = open_handles()
        await until(lambda: not status._visits, PATIENCE)
        assert open_handles() <= handles
        for _, writer in visitors:
            writer.transport.abort()


async def test_a_configuration_on_a_share_that_hangs(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("igrow.edge.reloading.RELOAD_SECONDS", 2.0)
    async with bench.running() as daemon:
        await bench.controls()
        file, away = bench.configuration, bench.folder / "away.yaml"
        file.rename(away)
        os.mkfifo(file)
        daemon.reload()
        await bench.goes_on()
        await until(lambda: "could not be read within 2 s" in daemon._configuration_problem, PATIENCE)
        file.unlink()
        away.rename(file)
        daemon.reload()
        await until(lambda: not daemon._configuration_problem, PATIENCE)
        hurry(daemon)
        file.unlink()
        os.mkfifo(file)
        daemon.reload()
    assert {"reload_refused", "reloaded"} <= set(bench.events())


async def test_a_watchdog_that_reads_nothing(bench: Bench) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as nobody_reads:
        nobody_reads.bind(str(bench.folder / "notify"))
        notifier = SystemdNotifier({"NOTIFY_SOCKET": str(bench.folder / "notify"), "WATCHDOG_USEC": "90000"})
        async with bench.running(notifier=notifier):
            await bench.controls()
            for _ in range(1000):
                notifier.still_waiting()
            await bench.goes_on()


WEATHER = """
  outdoor_temperature: {device: weather, function: input, address: 0, type: float32, unit: degC}
"""


def second_bus(bench: Bench, bus: str) -> None:
    """Add a weather station behind a bus of its own to the register map."""
    path = bench.folder / "map.yaml"
    devices = f"\n  other: {bus}\ndevices:\n  weather: {{bus: other, device_id: 2}}"
    path.write_text(path.read_text().replace("\ndevices:", devices) + WEATHER)


async def test_a_name_server_that_hangs(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    second_bus(bench, "{transport: tcp, host: weather.example, timeout: 0.5 s}")
    look_up, answers = socket.getaddrinfo, threading.Event()

    def hanging(host, *arguments, **named):
        if host == "weather.example":
            answers.wait()
        return look_up(host, *arguments, **named)

    monkeypatch.setattr(socket, "getaddrinfo", hanging)
    try:
        async with bench.running():
            await bench.controls()
            await bench.goes_on()
    finally:
        answers.set()


async def test_a_serial_port_whose_driver_hangs(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    second_bus(bench, "{transport: rtu, serial_port: /dev/ttyS77, timeout: 0.5 s}")
    answers = threading.Event()
    threads = set()

    class HangingTransport(SerialTransport):
        def __init__(self, *_: object) -> None:
            threads.add(threading.current_thread())
            answers.wait()
            raise OSError(5, "Input/output error")

    monkeypatch.setattr("igrow.edge.bus.serial_port.SerialTransport", HangingTransport)
    try:
        async with bench.running():
            await bench.controls()
            await bench.goes_on()
            assert len(threads) == 1
            assert threading.main_thread() not in threads
    finally:
        answers.set()


async def test_certificates_on_a_disk_that_hangs(bench: Bench, disk) -> None:
    certificates = disk("certificates")
    (bench.folder / "certificates").mkdir()
    write_whole(bench.folder / "certificates" / "plc.pem", b"")
    second_bus(bench, "{transport: tls, host: 127.0.0.1, certificate_authority: certificates/plc.pem, timeout: 0.5 s}")
    answers = threading.Event()

    async with bench.running():
        certificates.hang()
        await bench.controls()
        await bench.goes_on()
    answers.set()
    assert certificates.held == []


def open_handles() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def problems(daemon) -> list[str]:
    snapshot = daemon.services.status._snapshot
    assert snapshot is not None
    return [problem for problem in snapshot.problems if not problem.startswith("no plans")]
