"""The control cycle and a PLC with a fault proxy between, judged by what the PLC received.

Two invariants: no value outside the guard's limits is ever written, whatever the source of decisions asks for, and
no sensor's value is ever taken for another's.
"""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import Sequence

import pytest

from igrow.edge.bus.modbus_bus import ModbusBus
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.cycle import ControlCycle
from igrow.edge.guard import GuardedWriter, GuardRules, PointRule, Readback
from igrow.edge.image import Image
from igrow.edge.journal import Journal
from igrow.edge.registers.codec import decode
from igrow.edge.registers.loading import parse_register_map
from igrow.edge.registers.model import BusSettings, Function, Transport
from igrow.edge.sensors import ImageBuilder, SensorRule
from igrow.edge.sources import HandsOff, Offer
from igrow.edge.virtual_plc.memory import DeviceMemory
from igrow.edge.virtual_plc.modbus_server import ModbusServer
from tests.bus.fault_proxy import FaultProxy
from tests.bus.simulated_loop import run
from tests.control.control_fakes import MemoryStore

MAP = parse_register_map("""
title: a small greenhouse
source: none
buses:
  line: {transport: tcp, host: 127.0.0.1}
devices:
  plc: {bus: line, device_id: 1}
  weather: {bus: line, device_id: 2}
points:
  air_temperature: {device: plc, function: input, address: 0, type: float32, unit: degC}
  air_humidity: {device: plc, function: input, address: 2, type: float32, unit: "%"}
  air_co2: {device: plc, function: input, address: 4, type: float32, unit: ppm}
  vent_lee: {device: plc, function: input, address: 100, type: float32, unit: "%"}
  outdoor_temperature: {device: weather, function: input, address: 0, type: float32, unit: degC}
  outdoor_humidity: {device: weather, function: input, address: 2, type: float32, unit: "%"}
  wind_speed: {device: weather, function: input, address: 4, type: float32, unit: m s-1}
  heating_setpoint: {device: plc, function: holding, address: 0, type: float32, unit: degC, writable: true}
  co2_setpoint: {device: plc, function: holding, address: 2, type: float32, unit: ppm, writable: true}
  heartbeat: {device: plc, function: holding, address: 8, type: uint16, unit: "1", writable: true}
""")
SENSORS = {
    "air_temperature": 20.25,
    "air_humidity": 81.5,
    "air_co2": 612.0,
    "vent_lee": 33.0,
    "outdoor_temperature": 7.75,
    "outdoor_humidity": 90.5,
    "wind_speed": 4.5,
}
"""What each sensor shows, always: exact in a float32, and no two alike."""

RULES = {
    "heating_setpoint": PointRule(low=12.0, high=28.0, safe=18.0, slew=None, dead_band=0.1, minimum_interval=0.0),
    "co2_setpoint": PointRule(low=400.0, high=1000.0, safe=400.0, slew=None, dead_band=10.0, minimum_interval=10.0),
}
WILD = (math.nan, math.inf, -math.inf, 1e9, -1e9, 0.0, -40.0, 5000.0)
TIMEOUT = 0.5


class RecordingUnit(DeviceMemory):
    """A device that keeps what it was told to write."""

    def __init__(self, device: str) -> None:
        super().__init__(MAP, device)
        self.received: dict[str, list[float]] = {name: [] for name in RULES}
        for name in self.points.keys() & SENSORS.keys():
            self.set_value(name, SENSORS[name])

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        super().write(function, address, values)
        for name in RULES:
            point = self.points[name]
            if (point.function, point.address) == (function, address):
                value = decode(point, tuple(values))
                assert value is not None
                self.received[name].append(value)


class WildSource:
    """Asks for anything."""

    name = "plan"

    def __init__(self, generator: random.Random) -> None:
        self._random = generator

    def offer(self, image: Image) -> Offer:
        return Offer("wild", {name: self._wish(rule) for name, rule in RULES.items()})

    def _wish(self, rule: PointRule) -> float:
        return self._random.choice((*WILD, *(self._random.uniform(rule.low - 5, rule.high + 5) for _ in range(8))))


class LoopClock:
    """The simulated loop's time."""

    doubt = ""

    def __init__(self) -> None:
        self.monotonic = asyncio.get_running_loop().time

    def true_time(self) -> float:
        return 1.7e9 + self.monotonic()

    def recall(self, known: float | None) -> None:
        pass

    def witness(self, other: float) -> None:
        pass


async def play(seed: int, cycles: int = 15) -> tuple[int, int]:
    """Return how many sensor values were read and how many setpoints arrived; AssertionError for a violation."""
    generator = random.Random(seed)
    rtu = bool(seed % 2)
    unit = RecordingUnit("plc")
    server = ModbusServer({1: unit, 2: RecordingUnit("weather")})
    behind = await server.listen("127.0.0.1", 0, rtu=rtu)
    proxy = FaultProxy(behind, rtu=rtu, seed=seed, rate=generator.choice([0.1, 0.3, 0.6]), timeout=TIMEOUT)
    transport, gap = (Transport.RTU_OVER_TCP, 0.03) if rtu else (Transport.TCP, 0.0)
    settings = BusSettings("line", transport, "127.0.0.1", await proxy.listen(), timeout=TIMEOUT, gap=gap)
    clock = LoopClock()
    bus = ModbusBus(settings, monotonic=clock.monotonic)
    plc = RegisterPlc(MAP, monotonic=clock.monotonic, buses={"line": bus})
    cycle = ControlCycle(
        plc,
        clock,
        ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in MAP.points}),
        [WildSource(generator), HandsOff({name: rule.safe for name, rule in RULES.items()})],
        GuardRules(RULES, ()),
        Readback(RULES, confirm_within=60.0, respect_hand=0.0),
        GuardedWriter(plc, has_heartbeat=True),
        Journal(MemoryStore()),
        setpoints=tuple(RULES),
        respect_hand=0.0,
    )
    plc.start()
    seen = 0
    for _ in range(cycles):
        result = await cycle.run()
        seen += judge(seed, result.image, unit)
        await asyncio.sleep(5.0)
    await plc.close()
    await server.close()
    proxy.close()
    return seen, sum(map(len, unit.received.values()))


def judge(seed: int, image: Image, unit: RecordingUnit) -> int:
    seen = 0
    for name, truth in SENSORS.items():
        value = image.value_of(name).value
        if value is not None:
            assert value == truth, f"seed {seed}: {name} reads {value}, not {truth}"
            seen += 1
    for name, rule in RULES.items():
        for value in unit.received[name]:
            assert rule.low <= value <= rule.high, f"seed {seed}: {name} was written {value}"
        shown = image.value_of(name).value
        assert shown is None or shown in {0.0, *unit.received[name]}, f"seed {seed}: {name} shows {shown}"
    return seen


@pytest.mark.parametrize("start", range(0, 60, 10))
def test_no_write_leaves_the_limits_and_no_value_goes_astray_between_daemon_and_plc(start: int) -> None:
    results = [run(play(seed)) for seed in range(start, start + 10)]
    assert sum(seen for seen, _ in results) > 100
    assert sum(written for _, written in results) > 20


@pytest.mark.soak
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("start", range(1000, 11000, 1000))
def test_ten_thousand_fault_sequences_between_daemon_and_plc(start: int) -> None:
    results = [run(play(seed)) for seed in range(start, start + 1000)]
    assert sum(seen for seen, _ in results) > 10_000
    assert sum(written for _, written in results) > 2_000
