"""A clock that is a year off, ahead or behind, at a start of the daemon and while it runs."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from igrow.edge.clock import SystemClock
from igrow.edge.daemon import Daemon
from igrow.edge.store import read_telemetry
from igrow.edge.virtual_plc.pace import Realtime
from tests.control.daemon_bench import MAP, Plant, control_of, free_port, hurry, last, running, until, write_files

YEAR = 365 * 86_400.0
HAND = 555.0
WITHOUT_CLOCK = "".join(line for line in MAP.splitlines(keepends=True) if "plc_clock" not in line)
"""The plant's own date would be a witness."""

FREE = "  heating_setpoint: {low: 12, high: 28, safe: 18, slew: null, minimum_interval: 0 s}\n"


class Machine:
    """Whose date is off by so many seconds."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        machine, self.off = self, 0.0

        class Clock(SystemClock):
            def __init__(self) -> None:
                super().__init__(wall=lambda: time.time() + machine.off)

        monkeypatch.setattr("igrow.edge.wiring.SystemClock", Clock)
        monkeypatch.setattr("igrow.edge.clock.SETTLE_SECONDS", 2.0)


@contextlib.asynccontextmanager
async def hurried(path: Path) -> AsyncIterator[Daemon]:
    """A running daemon whose cycles follow one another quickly."""
    async with running(path) as daemon:
        await until(lambda: daemon._control is not None)
        hurry(daemon)
        yield daemon


def rows(folder: Path, around: float) -> int:
    """Return how much is logged of the five minutes before a date, and of the one after it."""
    return len(read_telemetry(folder / "state" / "store", around - 300.0, around + 60.0))


@pytest.mark.parametrize("years", [1, -1])
async def test_control_hands_and_log_outlive_a_clock_that_is_a_year_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, years: int
) -> None:
    machine, port = Machine(monkeypatch), free_port()
    path = write_files(tmp_path, port, clock="system", interval="1 s", map_text=WITHOUT_CLOCK)
    site = tmp_path / "site.yaml"
    site.write_text(site.read_text() + FREE)
    plant = Plant(tmp_path, port, pace=Realtime())
    await plant.up()

    async def lives_on(daemon, cycles: int = 4) -> None:
        before = daemon.cycles
        await until(lambda: daemon.cycles >= before + cycles)
        assert plant.shows("co2_setpoint") == HAND
        assert 18.0 < plant.shows("heating_setpoint") <= 19.0, "on its way from the safe value, or there"
        assert control_of(daemon).cycle.readback.hands(last(daemon).image.monotonic)["co2_setpoint"].seconds > 6000.0

    async with hurried(path) as daemon:
        await until(lambda: plant.shows("co2_setpoint") == 700.0 and plant.shows("heating_setpoint") == 19.0)
        await until(lambda: daemon.cycles >= 4)
        plant.plc.memory.set_value("co2_setpoint", HAND)
        await until(lambda: control_of(daemon).cycle.readback.hands(last(daemon).image.monotonic))
        machine.off = years * YEAR  # while it runs
        await lives_on(daemon)
        machine.off = 0.0
        await until(lambda: last(daemon).image.true_time is not None)
        await lives_on(daemon)
        machine.off = years * YEAR
        await until(lambda: last(daemon).image.true_time is None)
    async with hurried(path) as daemon:  # at a start
        await until(lambda: daemon.cycles >= 1)
        await lives_on(daemon, 8)
        machine.off = 0.0  # and a time service sets it right
        await lives_on(daemon)
        await until(lambda: last(daemon).image.true_time is not None)
        await lives_on(daemon)
        alarms = {alarm.name for alarm in daemon._journal.alarms.active}
    assert "clock" not in alarms
    logged = rows(tmp_path, time.time())
    async with hurried(path) as daemon:
        await until(lambda: daemon.cycles >= 4)
        await lives_on(daemon)
    assert rows(tmp_path, time.time()) > logged > 0
    await plant.down()
