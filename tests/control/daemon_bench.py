"""A daemon, its files and a virtual PLC over a real socket, for tests that play faults."""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from pathlib import Path

import numpy as np

from igrow.edge.configuration import load_configuration
from igrow.edge.cycle_result import CycleResult
from igrow.edge.daemon import Daemon
from igrow.edge.pace import TickPace
from igrow.edge.ports import ActiveBundle, PlanningService
from igrow.edge.registers.loading import load_register_map
from igrow.edge.status.server import StatusServer
from igrow.edge.virtual_plc.pace import Lockstep, Pace
from igrow.edge.virtual_plc.virtual_plc import VirtualPlc
from igrow.edge.wiring import Control
from tests.patience import PATIENCE

MAP = """
title: test plant
source: this test
buses:
  line: {{transport: tcp, host: 127.0.0.1, port: {port}, timeout: 0.5 s}}
devices:
  plc: {{bus: line, device_id: 1}}
points:
  air_temperature: {{device: plc, function: input, address: 0, type: float32, unit: degC}}
  air_humidity: {{device: plc, function: input, address: 2, type: float32, unit: "%"}}
  air_co2: {{device: plc, function: input, address: 4, type: float32, unit: ppm}}
  global_radiation: {{device: plc, function: input, address: 6, type: float32, unit: W m-2}}
  wind_speed: {{device: plc, function: input, address: 8, type: float32, unit: m s-1}}
  plc_fallback: {{device: plc, function: input, address: 10, type: bit, bit: 0, unit: "1"}}
  plc_clock: {{device: plc, function: input, address: 11, type: uint32, unit: s}}
  heating_setpoint: {{device: plc, function: holding, address: 0, type: float32, unit: degC, writable: true}}
  co2_setpoint: {{device: plc, function: holding, address: 2, type: uint16, unit: ppm, writable: true}}
  heartbeat: {{device: plc, function: holding, address: 3, type: uint16, unit: "1", writable: true}}
"""

SITE = """
name: test-greenhouse
latitude: 52
longitude: 4.5
setpoints: [heating_setpoint, co2_setpoint]
limits:
  co2_setpoint: {low: 400, high: 1000, safe: 400, slew: null, minimum_interval: 0 s}
"""

DAEMON = """bundle: {bundle}
site: site.yaml
register_map: map.yaml
state: state
status: {{port: 0}}
cycle: {{interval: {interval}, clock: {clock}, respect_hand: {respect_hand}}}
recipe:
  heating_setpoint: [{{at: 00:00, value: {heating}}}]
  co2_setpoint: [{{at: 00:00, value: 700}}]
"""


class TablePlant:
    """A plant whose sensors show what a test says, with a little noise; it obeys nobody."""

    def __init__(self, start: str = "2026-03-01T00:00:00") -> None:
        self._time = np.datetime64(start, "s")
        self._random = np.random.default_rng(1)
        self.values = {
            "air_temperature": 20.0, "air_humidity": 70.0, "air_co2": 600.0, "global_radiation": 0.0, "wind_speed": 3.0,
        }  # fmt: skip
        self.frozen: set[str] = set()
        self.setpoints: Mapping[str, float] = {}
        self._shown: dict[str, float] = {}

    @property
    def time(self) -> np.datetime64:
        return self._time

    def step(self, seconds: float, setpoints: Mapping[str, float]) -> None:
        self._time += np.timedelta64(round(seconds), "s")
        self.setpoints = dict(setpoints)

    def measurements(self) -> Mapping[str, float]:
        for name, value in self.values.items():
            if name not in self.frozen or name not in self._shown:
                noise = 0.0 if name == "global_radiation" else 0.05 * self._random.standard_normal()
                self._shown[name] = value + noise
        return dict(self._shown)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def write_files(
    folder: Path, port: int, *, clock: str = "lockstep", interval: str = "5 min", heating: float = 19.0,
    respect_hand: str = "2 h", map_text: str = MAP, bundle: str = "null",
) -> Path:  # fmt: skip
    """Write its files; without a bundle, whose self-test takes half of a start, where a test says nothing of one."""
    (folder / "map.yaml").write_text(map_text.format(port=port))
    (folder / "site.yaml").write_text(SITE)
    path = folder / "daemon.yaml"
    path.write_text(
        DAEMON.format(clock=clock, interval=interval, heating=heating, respect_hand=respect_hand, bundle=bundle)
    )
    return path


class Plant:
    """The PLC's side: can be started, stopped and started again on the same port."""

    def __init__(
        self, folder: Path, port: int, pace: Pace | None = None, start: str = "2026-03-01T00:00:00",
        device: str | None = None,
    ) -> None:  # fmt: skip
        self.table = TablePlant(start)
        self._map = load_register_map(folder / "map.yaml")
        self._pace = pace or Lockstep(300.0)
        self._port = port
        self._device = device
        self._plc: VirtualPlc | None = None

    @property
    def plc(self) -> VirtualPlc:
        """The PLC, from when the plant was up first."""
        assert self._plc is not None
        return self._plc

    async def up(self) -> None:
        self._plc = VirtualPlc(self.table, self._map, self._pace, device=self._device)
        await self.plc.start(port=self._port)

    async def down(self) -> None:
        await self.plc.close()

    def shows(self, name: str) -> float:
        value = self.plc.memory.value(name)
        assert value is not None
        return value


async def until(condition: Callable[[], object], seconds: float = PATIENCE) -> None:
    """Wait for a condition; the limit only says when a test has failed."""
    async with asyncio.timeout(seconds):
        while not condition():  # noqa: ASYNC110 - what is waited for happens in other tasks and processes
            await asyncio.sleep(0.01)


def control_of(daemon: Daemon) -> Control:
    """What it controls with; it has begun to."""
    assert daemon._control is not None
    return daemon._control


def hurry(daemon: Daemon) -> None:
    """Let its cycles follow one another quickly; by its configuration they do each second at most."""
    pace = control_of(daemon).pace
    assert isinstance(pace, TickPace)
    pace._interval = 0.05


def last(daemon: Daemon) -> CycleResult:
    """What its last cycle came to; there was one."""
    assert daemon.last is not None
    return daemon.last


def status_port(daemon: Daemon) -> int:
    """Where its page is served."""
    assert isinstance(daemon.services.status, StatusServer)
    return daemon.services.status.port


async def plan_at_once(daemon: Daemon, planner: PlanningService, bundle: Path) -> None:
    """Have plans made by `planner`, from the next cycle on."""
    # What the daemon's own planner has begun may end with "a day of log is needed", which would hold for this one too.
    own = daemon.services.planning
    await until(lambda: own is None or not own.busy)
    daemon.services.planning = planner
    daemon.services.updates.active = lambda: ActiveBundle("test", bundle)
    schedule = control_of(daemon).schedule
    assert schedule is not None
    schedule._service = planner
    schedule._due = schedule._young_until = -math.inf


@contextlib.asynccontextmanager
async def running(path: Path, **replaced: object) -> AsyncIterator[Daemon]:
    """A running daemon, stopped at the end. Raises what its run raised."""
    daemon = Daemon(load_configuration(path), **replaced)  # type: ignore[arg-type]
    task = asyncio.create_task(daemon.run())
    try:
        yield daemon
    finally:
        daemon.stop()
        await asyncio.wait_for(task, PATIENCE)
