"""A control cycle on real buses in simulated time: two units on one or two lines, each behind a fault proxy."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.clock import SystemClock, TrustedTime
from igrow.edge.cycle import ControlCycle
from igrow.edge.guard import GuardedWriter, GuardRules, PointRule, Readback
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.image import Image
from igrow.edge.journal import Journal
from igrow.edge.registers.codec import decode
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.look_alikes import look_alikes
from igrow.edge.registers.model import BusSettings, Function, RegisterMap, Transport
from igrow.edge.sensors import ImageBuilder, SensorRule
from igrow.edge.sources import HandsOff, Source
from igrow.edge.stopping import STOP_SECONDS, StopReport
from igrow.edge.virtual_plc.memory import DeviceMemory
from igrow.edge.virtual_plc.modbus_server import ModbusServer, Unit
from tests.bus.fault_proxy import FaultProxy
from tests.control.control_fakes import MemoryStore

TEXT = """
title: a small greenhouse
source: none
buses:
  first: {{transport: tcp, host: 127.0.0.1}}
  second: {{transport: tcp, host: 127.0.0.1}}
devices:
  plc: {{bus: first, device_id: 1}}
  other: {{bus: {other}, device_id: 2}}
points:
  air_temperature: {{device: plc, function: input, address: 0, type: float32, unit: degC}}
  air_humidity: {{device: plc, function: input, address: 2, type: float32, unit: "%"}}
  air_co2: {{device: plc, function: input, address: 4, type: float32, unit: ppm}}
  vent_lee: {{device: plc, function: input, address: 100, type: float32, unit: "%"}}
  outdoor_temperature: {{device: other, function: input, address: 0, type: float32, unit: degC}}
  outdoor_humidity: {{device: other, function: input, address: 2, type: float32, unit: "%"}}
  wind_speed: {{device: other, function: input, address: 4, type: float32, unit: m s-1}}
  heating_setpoint: {{device: plc, function: holding, address: 0, type: float32, unit: degC, writable: true}}
  co2_setpoint: {{device: plc, function: holding, address: 2, type: float32, unit: ppm, writable: true}}
  lamp_on: {{device: other, function: holding, address: 0, type: float32, unit: "1", writable: true}}
  irrigation_on: {{device: other, function: holding, address: 2, type: float32, unit: "1", writable: true}}
  heartbeat: {{device: plc, function: holding, address: 8, type: uint16, unit: "1", writable: true}}
"""
SENSORS = {
    "air_temperature": 20.25,
    "air_humidity": 81.5,
    "air_co2": 612.0,
    "vent_lee": 33.0,
    "outdoor_temperature": 7.75,
    "outdoor_humidity": 90.5,
    "wind_speed": 4.5,
}
"""What each sensor shows while it is well: exact in a float32, and no two alike."""
RULES = {
    "heating_setpoint": PointRule(low=12.0, high=28.0, safe=18.0, dead_band=0.1),
    "co2_setpoint": PointRule(low=400.0, high=1000.0, safe=400.0, dead_band=10.0),
    "lamp_on": PointRule(low=0.0, high=1.0, safe=0.0, dead_band=0.05),
    "irrigation_on": PointRule(low=0.0, high=1.0, safe=0.125, dead_band=0.02),
}
SAFE = {name: rule.safe for name, rule in RULES.items()}
TIMEOUT = 0.5
LOOK = 1e-5
"""Seconds."""
INTERVAL = 5.0


def register_map(*, two_buses: bool) -> RegisterMap:
    return parse_register_map(TEXT.format(other="second" if two_buses else "first"))


class RecordingUnit(DeviceMemory):
    """A device that keeps what it was told to write, and makes of it what it likes."""

    def __init__(self, points: RegisterMap, device: str) -> None:
        super().__init__(points, device)
        self.received: dict[str, list[tuple[float, float]]] = {}
        """By point: when what was written."""
        self.makes: dict[str, Callable[[float], float]] = {}
        self.loop = asyncio.get_running_loop()
        for name in self.points.keys() & SENSORS.keys():
            self.set_value(name, SENSORS[name])
        for name in self.points.keys() & SAFE.keys():
            self.set_value(name, SAFE[name])

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        super().write(function, address, values)
        for name, point in self.points.items():
            if (point.function, point.address) == (function, address):
                value = decode(point, tuple(values))
                assert value is not None
                self.received.setdefault(name, []).append((self.loop.time(), value))
                if name in self.makes:
                    self.set_value(name, self.makes[name](value))

    def beaten_at(self) -> float | None:
        """Return when the heartbeat last changed; None before it ever did."""
        beats = self.received.get("heartbeat")
        return beats[-1][0] if beats else None


class LoopClock(SystemClock):
    """The simulated loop's time, with a date that may be wrong by `ahead` seconds."""

    def __init__(self) -> None:
        self.ahead = 0.0
        self.loop = asyncio.get_running_loop()
        self._looks = 0
        super().__init__(self._passing, lambda: 1.8e9 + self.loop.time() + self.ahead)
        self._trusted = TrustedTime(synchronised=lambda: False)

    def _passing(self) -> float:
        # Between two looks at a real clock some time has passed, even where a simulated answer takes none.
        self._looks += 1
        return self.loop.time() + LOOK * self._looks


@dataclass
class Notes:
    """Keeps the newest of what a restart must not forget."""

    content: Mapping[str, object] = field(default_factory=dict)
    at: float = 0.0

    def keep(self, image: Image, content: Mapping[str, object]) -> None:
        self.content, self.at = content, image.monotonic


@dataclass
class PlcBench:
    """What a test needs at hand."""

    map: RegisterMap
    units: Mapping[str, RecordingUnit]
    proxies: Mapping[str, FaultProxy]
    servers: Sequence[ModbusServer]
    clock: LoopClock
    store: MemoryStore
    notes: Notes
    build: Callable[[bool], tuple[RegisterPlc, ControlCycle]]
    """Makes what a process has; tells it whether there was one before."""
    plc: RegisterPlc
    cycle: ControlCycle
    running: list[asyncio.Future[object]] = field(default_factory=list)

    def unit_of(self, name: str) -> RecordingUnit:
        return next(unit for unit in self.units.values() if name in unit.points)

    @property
    def numbers(self) -> list[dict[int, Unit]]:
        """What answers under which number, on the first line and on the last one, which may be the same."""
        return [cast(dict[int, Unit], self.servers[place]._units) for place in (0, -1)]

    def change_places(self) -> None:
        """Let each unit answer under the other's number, or address where it has a line of its own."""
        first, second = self.numbers
        first[1], second[2] = second[2], first[1]

    def stands(self, name: str) -> float | None:
        return self.unit_of(name).value(name)

    def received(self, name: str) -> list[float]:
        return [value for _, value in self.unit_of(name).received.get(name, [])]

    async def stop(self, during: asyncio.Future[Any] | None = None) -> tuple[StopReport, float]:
        """Stop as the daemon does, in the middle of a cycle or between two; returns the report and how long it took."""
        begin = asyncio.get_running_loop().time()
        if during is not None and not during.done():
            self.cycle.give_way()
            await asyncio.wait((during,))
        self.plc.last_orders()
        took = asyncio.get_running_loop().time() - begin
        report = await self.cycle.stop(STOP_SECONDS - took)
        return report, asyncio.get_running_loop().time() - begin

    async def restart(self, respect_hand: float) -> None:
        """End the process without a word, and begin another one that knows what the old one noted."""
        await self.plc.close()
        self.plc, self.cycle = self.build(True)
        agree = self.clock.monotonic() - self.notes.at <= respect_hand
        self.cycle.recall(self.notes.content, 0.0, same={*self.cycle.readback.points, HEARTBEAT}, agree=agree)

    async def close(self) -> None:
        await self.plc.close()
        for server in self.servers:
            await server.close()
        for proxy in self.proxies.values():
            proxy.close()


async def make_plc_bench(
    sources: Sequence[Source],
    *,
    two_buses: bool = False,
    rtu: bool = False,
    seed: int = 1,
    rate: float = 0.0,
    timeout: float = TIMEOUT,  # noqa: ASYNC109 - the bus'
    respect_hand: float = 0.0,
    store: MemoryStore | None = None,
    unit: type[RecordingUnit] = RecordingUnit,
) -> PlcBench:
    """Put it together; the buses are being connected when this returns."""
    points = register_map(two_buses=two_buses)
    units = {name: unit(points, name) for name in points.devices}
    clock = LoopClock()
    proxies, settings, servers = {}, {}, []
    for number, name in enumerate(("first", "second") if two_buses else ("first",)):
        mine = [d for d in points.devices.values() if d.bus == name]
        server = ModbusServer({device.device_id: units[device.name] for device in mine})
        behind = await server.listen("127.0.0.1", 0, rtu=rtu)
        proxy = FaultProxy(behind, rtu=rtu, seed=seed + 1_000_000 * number, rate=rate, timeout=timeout)
        transport, gap = (Transport.RTU_OVER_TCP, 0.03) if rtu else (Transport.TCP, 0.0)
        settings[name] = BusSettings(name, transport, "127.0.0.1", await proxy.listen(), timeout=timeout, gap=gap)
        proxies[name] = proxy
        servers.append(server)
    store, notes = store or MemoryStore(), Notes()
    devices = {name: point.device for name, point in points.points.items()}

    def build(others_asked: bool) -> tuple[RegisterPlc, ControlCycle]:
        buses = {
            name: ModbusBus(one, monotonic=clock.monotonic, others_asked=others_asked) for name, one in settings.items()
        }
        plc = RegisterPlc(points, monotonic=clock.monotonic, buses=buses)
        cycle = ControlCycle(
            plc,
            clock,
            ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in points.points}, units=devices),
            [*sources, HandsOff(SAFE)],
            GuardRules(RULES, ()),
            Readback(
                RULES,
                confirm_within=60.0,
                respect_hand=respect_hand,
                silence=3 * INTERVAL,
                units=devices,
                look_alikes=look_alikes(points, RULES),
            ),
            GuardedWriter(plc, has_heartbeat=True),
            Journal(store),
            setpoints=tuple(RULES),
            respect_hand=respect_hand,
            keep=notes.keep,
        )
        plc.start()
        return plc, cycle

    return PlcBench(points, units, proxies, servers, clock, store, notes, build, *build(False))
