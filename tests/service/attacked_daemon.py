"""The daemon as a process of its own on the machine's clock, before a PLC that does what a test says."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from igrow.edge.registers.codec import decode
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import Function
from igrow.edge.virtual_plc.memory import ILLEGAL_ADDRESS, AnswerWithExceptionError, DeviceMemory
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from tests.patience import PATIENCE
from tests.service.running_daemon import COMMAND, ROOT

MAP = """
title: attacked plant
source: this test
buses:
  line: {{transport: tcp, host: "{host}", port: {port}, timeout: 1 s}}
devices:
  plc: {{bus: line, device_id: 1}}
points:
  air_temperature: {{device: plc, function: input, address: 0, type: float32, unit: degC}}
  air_humidity: {{device: plc, function: input, address: 2, type: float32, unit: "%"}}
  air_co2: {{device: plc, function: input, address: 4, type: float32, unit: ppm}}
  wind_speed: {{device: plc, function: input, address: 6, type: float32, unit: m s-1}}
  vent_lee: {{device: plc, function: holding, address: 20, type: float32, unit: "%", writable: true}}
  vent_wind: {{device: plc, function: holding, address: 22, type: float32, unit: "%", writable: true}}
  heating_setpoint: {{device: plc, function: holding, address: 0, type: float32, unit: degC, writable: true}}
  co2_setpoint: {{device: plc, function: holding, address: 2, type: float32, unit: ppm, writable: true}}
  heartbeat: {{device: plc, function: holding, address: 4, type: uint16, unit: "1", writable: true}}
"""
SITE = """
name: attacked
latitude: 52
longitude: 4.5
setpoints: [heating_setpoint, co2_setpoint]
limits:
  heating_setpoint: {low: 12, high: 28, safe: 18, slew: null, minimum_interval: 0 s}
  co2_setpoint: {low: 400, high: 1000, safe: 400, slew: null, minimum_interval: 0 s}
"""
DAEMON = """
site: site.yaml
register_map: map.yaml
state: state
bundle: null
status: {port: 0}
planning: {enabled: false}
cycle: {interval: 1 s, respect_hand: 10 min}
recipe:
  heating_setpoint: [{at: 00:00, value: 18.3}]
  co2_setpoint: [{at: 00:00, value: 703}]
"""
SENSORS = {"air_temperature": 19.4, "air_humidity": 71.7, "air_co2": 613.3, "wind_speed": 3.2}
WISH = {"heating_setpoint": 18.3, "co2_setpoint": 703.0}
SAFE = {"heating_setpoint": 18.0, "co2_setpoint": 400.0}


class AttackedPlc(DeviceMemory):
    """Registers that a test looks at and changes; `refuses` answers requests to read or write with an exception."""

    def __init__(self, text: str = MAP, device: str = "plc") -> None:
        super().__init__(parse_register_map(text.format(host="127.0.0.1", port=502)), device)
        self.device = device
        self.lock = threading.RLock()
        self.received: list[tuple[float, str, float]] = []
        """When what was written to which point."""
        self.refuses: dict[str, int] = {}
        """By "read" or "write": the exception."""
        self.before_write: Callable[[str, float], None] = lambda name, value: None
        self.after_read: Callable[[Function, int, list[int]], list[int]] = lambda function, address, words: words
        for name, value in {**SENSORS, "heating_setpoint": 18.3, "co2_setpoint": 500.0}.items():
            if name in self.points:
                self.set_value(name, value)

    def read(self, function: Function, address: int, count: int) -> list[int]:
        with self.lock:
            if code := self.refuses.get("read"):
                raise AnswerWithExceptionError(code)
            return self.after_read(function, address, super().read(function, address, count))

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        with self.lock:
            if code := self.refuses.get("write"):
                raise AnswerWithExceptionError(code)
            place = function, address
            name = next((name for name, point in self.points.items() if (point.function, point.address) == place), None)
            if name is None:
                raise AnswerWithExceptionError(ILLEGAL_ADDRESS)
            value = decode(self.points[name], tuple(values))
            assert value is not None
            self.before_write(name, value)
            super().write(function, address, values)
            self.received.append((time.monotonic(), name, value))

    def shows(self, name: str) -> float | None:
        value = self.value(name)
        return None if value is None else round(value, 4)

    def beats(self) -> int:
        """Return how often the heart has beaten."""
        return sum(name == "heartbeat" for _, name, _ in list(self.received))

    def written(self, since: int = 0) -> list[tuple[str, float]]:
        """Return what was written beside the heartbeat, from the so-many-th write on."""
        return [(name, round(value, 4)) for _, name, value in list(self.received)[since:] if name != "heartbeat"]


class AttackedDaemon:
    """A daemon in a folder of its own, and the server of its PLC in a thread."""

    def __init__(
        self,
        folder: Path,
        *,
        text: str = MAP,
        host: str = "127.0.0.1",
        extra: str = "",
        units: Mapping[int, str] = MappingProxyType({1: "plc"}),
    ) -> None:
        """`units` are the devices of the map by their numbers; the first is `plc`, and a test may move them."""
        self.folder, self.state = folder, folder / "state"
        self.units = {number: AttackedPlc(text, device) for number, device in units.items()}
        self.plc = next(iter(self.units.values()))
        self.loop = asyncio.new_event_loop()
        self.server = ModbusServer(self.units)
        self._thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self._thread.start()
        self.port = self.do(self.server.listen("127.0.0.1", 0))
        self.configuration = folder / "daemon.yaml"
        self.text = text
        self.write_files(host, self.port, extra)
        self.process: subprocess.Popen[bytes] | None = None

    def write_files(self, host: str, port: int, extra: str = "") -> None:
        (self.folder / "map.yaml").write_text(self.text.format(host=host, port=port))
        (self.folder / "site.yaml").write_text(SITE)
        self.configuration.write_text(DAEMON + extra)

    def do(self, work: Any) -> Any:
        """Run a coroutine in the server's thread."""
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(30.0)

    def start(self, **environment: str) -> None:
        """Start the daemon; its log goes to a file."""
        with (self.folder / "daemon.log").open("ab") as log:
            self.process = subprocess.Popen(
                [*COMMAND, "run", str(self.configuration)], stdout=log, stderr=log,
                env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), **environment},
            )  # fmt: skip

    def signal(self, number: int) -> None:
        assert self.process is not None
        self.process.send_signal(number)

    def ended(self) -> int:
        """Wait for the daemon's end; returns its exit status."""
        assert self.process is not None
        return self.process.wait(PATIENCE)

    def log(self) -> str:
        return (self.folder / "daemon.log").read_text()

    def status(self) -> Mapping[str, Any]:
        """Return what the daemon says of itself; empty before its first cycle."""
        try:
            state: Mapping[str, Any] = json.loads((self.state / "status.json").read_text())["state"] or {}
        except (OSError, ValueError, KeyError):
            return {}
        return state

    def port_of_status(self) -> int:
        """Return where its status port is, 0 before it has said so."""
        try:
            return int(json.loads((self.state / "status.json").read_text())["port"])
        except (OSError, ValueError, KeyError):
            return 0

    def until(self, condition: Callable[[], object], seconds: float = PATIENCE) -> None:
        """Wait until a condition holds, while the daemon lives."""
        end = time.monotonic() + seconds
        while not condition():
            assert self.process is None or self.process.poll() is None, self.log()[-3000:]
            assert time.monotonic() < end, self.log()[-3000:]
            time.sleep(0.02)

    def beats(self, more: int) -> None:
        """Wait until the heart has beaten so many times more."""
        before = self.plc.beats()
        self.until(lambda: self.plc.beats() >= before + more)

    def controls(self) -> None:
        """Wait until the setpoints stand where the recipe wants them; the heating setpoint does from the start."""
        self.until(lambda: all(self.plc.shows(name) == value for name, value in WISH.items()))

    def close(self) -> None:
        """End everything."""
        if self.process is not None:
            with contextlib.suppress(ProcessLookupError):
                self.process.kill()
            self.process.wait()
        self.do(self.server.close())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(10.0)
