"""A daemon on a virtual PLC whose cycles follow one another quickly, for tests that hang what it works with."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from igrow.edge import daemon as daemon_module
from igrow.edge.configuration import load_configuration
from igrow.edge.daemon import Daemon
from igrow.edge.store import read_records
from igrow.edge.virtual_plc.pace import Realtime
from tests.control.daemon_bench import Plant, free_port, hurry, until, write_files
from tests.patience import PATIENCE
from tests.tiny_bundle import write_tiny_bundle

SAFE = {"heating_setpoint": 18.0, "co2_setpoint": 400.0}
PROMPT = "minimum_interval: 0 s, dead_band: 0.1}\n"
CYCLES = 25
"""That have to follow while something hangs."""


class Bench:
    """A greenhouse, and the daemon that runs it while things hang."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.port = free_port()
        self.configuration = write_files(folder, self.port, clock="system", interval="1 s", bundle="first")
        site = folder / "site.yaml"
        site.write_text(site.read_text() + "  heating_setpoint: {low: 12, high: 28, safe: 18, slew: null, " + PROMPT)
        self.plant = Plant(folder, self.port, pace=Realtime())
        self.daemon: Daemon | None = None

    def add(self, text: str) -> None:
        """Add lines to the daemon's configuration."""
        with self.configuration.open("a") as stream:
            stream.write(text)

    @property
    def store(self) -> Path:
        return self.folder / "state" / "store"

    @contextlib.asynccontextmanager
    async def running(self, stops_at: Mapping[str, float] = SAFE, **replaced: Any) -> AsyncIterator[Daemon]:
        """Run the daemon; then stop it, and hold it to what a stop promises, whatever hangs by then."""
        await self.plant.up()
        self.daemon = daemon = Daemon(load_configuration(self.configuration), **replaced)
        task = asyncio.create_task(daemon.run())
        try:
            await until(lambda: daemon._control is not None, PATIENCE)
            hurry(daemon)
            yield daemon
            assert self.plant.shows("co2_setpoint") != SAFE["co2_setpoint"]
            daemon.stop()
            await until(lambda: {name: self.plant.shows(name) for name in stops_at} == stops_at, PATIENCE)
        finally:
            daemon.stop()
            await asyncio.wait_for(task, PATIENCE)
            await self.plant.down()

    async def controls(self) -> None:
        """Wait until control has taken hold."""
        await until(lambda: self.plant.shows("heating_setpoint") == 19.0, PATIENCE)

    async def goes_on(self) -> None:
        """Wait for many more cycles, and as many heartbeats."""
        assert self.daemon is not None
        daemon = self.daemon
        cycles, beat = daemon.cycles, self.plant.shows("heartbeat")
        await until(lambda: daemon.cycles > cycles + CYCLES, PATIENCE)
        assert self.plant.shows("heartbeat") >= beat + CYCLES - 2

    def events(self) -> list[str]:
        return [str(record.body["kind"]) for record in read_records(self.store, "event")]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setattr(daemon_module, "CLOSE_SECONDS", 8.0)
    write_tiny_bundle(tmp_path / "first", site="test-greenhouse")
    return Bench(tmp_path)
