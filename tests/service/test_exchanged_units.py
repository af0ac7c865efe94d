"""The daemon as a process, and two of its units that change places while it runs: after a service, or a new address."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.attacked_daemon import MAP as ONE_PLC
from tests.service.attacked_daemon import AttackedDaemon, AttackedPlc

MAP = """
title: two controllers of one make
source: this test
buses:
  line: {{transport: tcp, host: "{host}", port: {port}, timeout: 1 s}}
devices:
  heating: {{bus: line, device_id: 1{heating}}}
  dosing: {{bus: line, device_id: 2{dosing}}}
points:
  air_temperature: {{device: heating, function: input, address: 0, type: float32, unit: degC}}
  air_co2: {{device: dosing, function: input, address: 0, type: float32, unit: ppm}}
  heating_setpoint: {{device: heating, function: holding, address: 0, type: float32, unit: degC, writable: true}}
  co2_setpoint: {{device: dosing, function: holding, address: 0, type: float32, unit: ppm, writable: true}}
  heartbeat: {{device: heating, function: holding, address: 2, type: uint16, unit: "1", writable: true}}
"""
WISH = {"heating_setpoint": 18.3, "co2_setpoint": 703.0}


IDENTITIES = {
    "heating": ", identity: {{function: input, address: 2, content: [11]}}",
    "dosing": ", identity: {{function: input, address: 2, content: [12]}}",
}


class TwoUnits:
    """A daemon before two units, which a test lets change places."""

    def __init__(self, folder: Path, **identities: str) -> None:
        self.text = MAP
        for name in ("heating", "dosing"):
            self.text = self.text.replace(f"{{{name}}}", identities.get(name, ""))
        self.daemon = AttackedDaemon(folder, text=self.text, units={1: "heating", 2: "dosing"})
        self.units = self.daemon.units

    def change_places(self) -> dict[str, int]:
        """Let each answer under the other's number; returns how much had been written to each."""
        with self.daemon.plc.lock:
            self.units[1], self.units[2] = self.units[2], self.units[1]
            return self.received()

    def received(self) -> dict[str, int]:
        return {unit.device: len(unit.received) for unit in self.units.values()}

    def shows(self, name: str) -> float | None:
        return next(unit.shows(name) for unit in self.units.values() if name in unit.points)

    def controls(self) -> None:
        self.daemon.until(lambda: all(self.shows(name) == value for name, value in WISH.items()))
        before = self.received()["heating"]
        self.daemon.until(lambda: self.received()["heating"] >= before + 3)

    def alarms(self) -> list[str]:
        """Return what is said of the units' registers."""
        alarms = self.daemon.status().get("alarms", [])
        return [alarm["text"] for alarm in alarms if alarm["name"].startswith("registers")]

    def cycles(self, more: int) -> None:
        before = self.daemon.status().get("cycle", 0)
        self.daemon.until(lambda: self.daemon.status().get("cycle", 0) >= before + more)


@pytest.fixture
def two(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[TwoUnits]:
    units = TwoUnits(tmp_path, **getattr(request, "param", {}))
    units.daemon.start()
    units.controls()
    yield units
    units.daemon.close()


@pytest.mark.parametrize(
    ("two", "said"),
    [
        ({}, ["units dosing and heating show each other's setpoints"]),
        (IDENTITIES, ["unit dosing shows 11 in input 2, but", "unit heating shows 12 in input 2, but"]),
    ],
    indirect=["two"],
)
def test_two_units_that_change_places_while_the_daemon_runs_get_nothing(two: TwoUnits, said: list[str]) -> None:
    """Without any configuration, and where each says who it is."""
    before = two.change_places()
    two.daemon.until(two.alarms)
    two.cycles(5)
    assert sorted(text.split(" its `identity`")[0].split(", so")[0] for text in two.alarms()) == said
    after = two.received()
    assert after["dosing"] == before["dosing"]
    assert after["heating"] <= before["heating"] + 1, "the cycle that was under way may end"
    two.change_places()
    two.controls()
    two.daemon.until(lambda: not two.alarms())
    assert "by hand at the PLC" not in two.daemon.log()


def test_a_map_that_says_where_the_units_are_now_ends_it(two: TwoUnits) -> None:
    two.change_places()
    two.daemon.until(two.alarms)
    text = two.text.replace("device_id: 1", "FIRST").replace("device_id: 2", "device_id: 1")
    two.daemon.text = text.replace("FIRST", "device_id: 2")
    two.daemon.write_files("127.0.0.1", two.daemon.port)
    two.daemon.signal(signal.SIGHUP)
    two.daemon.until(lambda: "read again" in two.daemon.log())
    two.controls()
    two.daemon.until(lambda: not two.alarms())
    assert "by hand at the PLC" not in two.daemon.log()


def test_another_plc_of_the_same_make_at_the_address_gets_nothing(tmp_path: Path) -> None:
    """A DHCP server gives two greenhouses' PLCs each the other's address: each daemon meets the other's PLC."""
    mine = ONE_PLC.replace("device_id: 1", "device_id: 1, identity: {{function: input, address: 8, content: [11]}}")
    daemon = AttackedDaemon(tmp_path, text=mine)
    try:
        daemon.start()
        daemon.controls()
        daemon.beats(3)
        other = AttackedPlc(mine.replace("[11]", "[12]"))
        with daemon.plc.lock:
            daemon.units[1] = other
        daemon.loop.call_soon_threadsafe(daemon.server.drop_connections)
        daemon.until(lambda: "unit plc shows 12 in input 8, but" in daemon.log())
        before = daemon.status()["cycle"]
        daemon.until(lambda: daemon.status()["cycle"] >= before + 5)
        assert other.received == []
        daemon.signal(signal.SIGTERM)
        assert daemon.ended() == 0
        assert other.received == []
        assert "shows 12 in input 8" in daemon.log().rsplit("stopped:", 1)[1]
    finally:
        daemon.close()
