"""The whole daemon, with its store and its files, and a PLC behind the fault proxy, over real sockets.

The same two invariants as for the control cycle alone: nothing outside the limits is written, and no value is kept
under another's name; here judged by what the PLC received and by what stands in the log.
"""

from __future__ import annotations

import random
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from igrow.edge import pace
from igrow.edge.bus import connect_supervisor
from igrow.edge.bus import plc as bus_of_plc
from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.daemon import Daemon
from igrow.edge.registers.codec import decode
from igrow.edge.registers.model import BusSettings, Device, Function
from igrow.edge.sources.override import Lease, write_leases
from igrow.edge.store import read_records, read_telemetry
from tests.bus.fault_proxy import NETWORK, Fault, FaultProxy
from tests.control.daemon_bench import Plant, free_port, running, until, write_files

TIMEOUT = 0.05
SENSORS = {
    "air_temperature": 20.0,
    "air_humidity": 70.0,
    "air_co2": 600.0,
    "global_radiation": 0.0,
    "wind_speed": 3.0,
}
"""No two within each other's noise, which is 0.05."""
LIMITS = {"heating_setpoint": (12.0, 28.0), "co2_setpoint": (400.0, 1000.0)}
WISHES = {"heating_setpoint": (-40.0, 12.0, 19.0, 28.0, 99.0), "co2_setpoint": (0.0, 400.0, 700.0, 1000.0, 60_000.0)}


class Recorder:
    """Keeps what a PLC's memory was told to write."""

    def __init__(self, plant: Plant) -> None:
        assert plant.plc is not None
        self._memory = plant.plc.memory
        self._write = self._memory.write
        self.received: dict[str, list[float]] = {name: [] for name in LIMITS}
        self._memory.write = self.write

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        self._write(function, address, values)
        for name, received in self.received.items():
            point = self._memory.points[name]
            if (point.function, point.address) == (function, address):
                value = decode(point, tuple(values))
                assert value is not None
                received.append(value)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no unit or line rest and the plant not be waited for, so that faults follow one another quickly."""

    def make_bus(settings: BusSettings, devices: Collection[Device], *, others_asked: bool = False) -> ModbusBus:
        return ModbusBus(settings, rest_step=0.0, first_wait=0.01, quiet=0.005, others_asked=others_asked)

    monkeypatch.setattr(connect_supervisor, "LONGEST_WAIT", 0.02)
    monkeypatch.setattr(bus_of_plc, "make_bus", make_bus)
    monkeypatch.setattr(pace, "PATIENCE", 0.1)


async def play(folder: Path, seed: int, cycles: int) -> Sequence[Fault]:
    """Run a daemon behind faults; returns what was done to each answer. AssertionError for a violation."""
    generator = random.Random(seed)
    port = free_port()
    path = write_files(folder, port)
    plant = Plant(folder, port)
    plant.table.values |= SENSORS
    await plant.up()
    recorder = Recorder(plant)
    proxy = FaultProxy(port, rtu=False, seed=seed, rate=0.2, timeout=TIMEOUT)
    text = (folder / "map.yaml").read_text()
    text = text.replace(f"port: {port}", f"port: {await proxy.listen()}").replace("0.5 s", f"{TIMEOUT} s")
    (folder / "map.yaml").write_text(text)
    async with running(path) as daemon:
        for stage in range(10, cycles, 10):
            await reached(daemon, stage)
            wishes = {name: Lease(generator.choice(WISHES[name]), 1e6) for name in LIMITS}
            assert write_leases(folder / "state" / "override.json", wishes) == ""
    proxy.close()
    await plant.down()
    judge(folder / "state" / "store", recorder.received)
    return proxy.faults


async def reached(daemon: Daemon, cycles: int) -> None:
    await until(lambda: daemon.cycles >= cycles, 300.0)


def judge(store: Path, received: Mapping[str, Sequence[float]]) -> None:
    for name, (low, high) in LIMITS.items():
        assert len(set(received[name])) > 1, f"{name} was hardly ever written"
        assert all(low <= value <= high for value in received[name]), f"{name} was written {received[name]}"
    telemetry = read_telemetry(store, 0.0, 8e9)
    assert len(telemetry) > 10
    for name, truth in SENSORS.items():
        shown = telemetry[name][np.isfinite(telemetry[name])]
        assert len(shown) > 10
        assert np.abs(shown - truth).max() < 1.0, f"{name} reads {shown}"
    assert {record.body["outcome"] for record in read_records(store, "write")} >= {"written", "confirmed", "clamped"}


@pytest.mark.usefixtures("quiet", "impatient")
async def test_the_whole_daemon_writes_nothing_wrong_and_keeps_nothing_under_another_name(tmp_path: Path) -> None:
    faults = await play(tmp_path, seed=1, cycles=100)
    assert len(faults) - faults.count(Fault.NONE) > 20


@pytest.mark.soak
@pytest.mark.usefixtures("quiet", "impatient")
@pytest.mark.parametrize("seed", range(10, 14))
async def test_the_same_holds_for_hundreds_of_cycles(tmp_path: Path, seed: int) -> None:
    faults = await play(tmp_path, seed, cycles=600)
    assert set(faults) == set(NETWORK)
