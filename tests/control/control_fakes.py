"""A PLC and the services of the gateway, with a few lines each, for tests of the control cycle."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from igrow.core.telemetry import Telemetry
from igrow.edge.bus.errors import BusError, NoAnswerError
from igrow.edge.bus.plc import Reading
from igrow.edge.cycle import ControlCycle
from igrow.edge.earlier import Earlier
from igrow.edge.guard import GuardedWriter, GuardRules, Interlock, PointRule, Readback
from igrow.edge.image import Image, Quality, Value
from igrow.edge.journal import Journal
from igrow.edge.records import AlarmRecord, WriteRecord
from igrow.edge.sensors import ImageBuilder, SensorRule
from igrow.edge.sources import HandsOff, Source
from tests.fake_clock import FakeClock

SETPOINTS = ("heating_setpoint", "co2_setpoint")

HEATING = PointRule(low=12.0, high=28.0, safe=18.0, slew=4.0 / 3600.0, dead_band=0.1, minimum_interval=300.0)
CO2 = PointRule(low=400.0, high=1000.0, safe=400.0, slew=None, dead_band=10.0, minimum_interval=60.0)

READ_AGAIN = 0.001
"""Seconds by which a second reading in a cycle is later than the first."""


class FakePlc:
    """Registers in a dictionary. `silent` plays a dead line, `ignores` points that take no write."""

    def __init__(self, clock: FakeClock, values: Mapping[str, float]) -> None:
        self.clock = clock
        self.values = dict(values)
        self.silent = False
        self.ignores: set[str] = set()
        self.write_error: BusError | None = None
        self.writes: list[tuple[float, str, float]] = []

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, Reading]:
        self.clock.advance(0.0 if names is None else READ_AGAIN)
        now = self.clock.monotonic()
        wanted = self.values if names is None else names
        if self.silent:
            return {name: Reading(None, NoAnswerError("no answer"), now) for name in wanted}
        return {name: Reading(self.values[name], None, now) for name in wanted}

    async def write(self, name: str, value: float) -> None:
        if self.write_error is not None:
            raise self.write_error
        if self.silent:
            raise NoAnswerError("no answer")
        self.writes.append((self.clock.monotonic(), name, value))
        if name not in self.ignores:
            self.values[name] = value

    async def close(self) -> None:
        return

    def written(self, name: str) -> list[float]:
        return [value for _, point, value in self.writes if point == name]


@dataclass
class MemoryStore:
    """Keeps every record in a list."""

    rows: list[tuple[float, Mapping[str, Value]]] = field(default_factory=list)
    events: list[tuple[str, Mapping[str, Any]]] = field(default_factory=list)
    writes: list[WriteRecord] = field(default_factory=list)
    alarms: list[AlarmRecord] = field(default_factory=list)
    states: list[Mapping[str, object]] = field(default_factory=list)
    health: str = ""

    def append(self, time: float, values: Mapping[str, Value]) -> None:
        self.rows.append((time, values))

    def record_event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        self.events.append((kind, dict(detail)))

    def record_write(self, record: WriteRecord) -> None:
        self.writes.append(record)

    def record_alarm(self, record: AlarmRecord) -> None:
        self.alarms.append(record)

    def earlier(self, log_seconds: float) -> Future[Earlier]:
        found: Future[Earlier] = Future()
        written = [record for record in self.writes if record.outcome == "written"]
        state = self.states[-1] if self.states else None
        found.set_result(Earlier(None, state, written, self.telemetry(0.0, 0.0)))
        return found

    def record_state(self, time: float | None, content: Mapping[str, object]) -> None:
        self.states.append(dict(content))

    def telemetry(self, start: float, end: float) -> Telemetry:
        return Telemetry(np.array([], dtype="datetime64[s]"), {})

    def newest_event(self, kind: str) -> Mapping[str, Any] | None:
        return next((detail for one, detail in reversed(self.events) if one == kind), None)

    def close(self) -> None:
        return

    def kinds(self) -> list[str]:
        return [kind for kind, _ in self.events]


@dataclass
class FixedSource:
    """Offers what it is told to."""

    setpoints: dict[str, float]
    name: str = "plan"

    def offer(self, image: Image):
        from igrow.edge.sources import Offer

        return Offer("as told", self.setpoints)


@dataclass
class Bench:
    """A cycle on a fake PLC, with everything at hand."""

    clock: FakeClock
    plc: FakePlc
    store: MemoryStore
    journal: Journal
    cycle: ControlCycle

    async def run(self, cycles: int = 1, seconds: float = 10.0) -> None:
        for _ in range(cycles):
            self.clock.advance(seconds)
            self.result = await self.cycle.run()


def make_bench(
    *,
    values: Mapping[str, float] | None = None,
    source: Source | None = None,
    rules: Mapping[str, PointRule] | None = None,
    interlocks: tuple[Interlock, ...] = (),
    respect_hand: float = 7200.0,
) -> Bench:
    clock = FakeClock()
    registers = {"air_temperature": 20.0, "heating_setpoint": 18.0, "co2_setpoint": 400.0, "heartbeat": 0.0}
    plc = FakePlc(clock, registers | dict(values or {}))
    store = MemoryStore()
    journal = Journal(store)
    points = dict(rules or {"heating_setpoint": HEATING, "co2_setpoint": CO2})
    safe = {name: rule.safe for name, rule in points.items()}
    sources = [source, HandsOff(safe)] if source is not None else [HandsOff(safe)]
    cycle = ControlCycle(
        plc,
        clock,
        ImageBuilder({name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in plc.values}),
        sources,
        GuardRules(points, interlocks),
        Readback(points, confirm_within=60.0, respect_hand=respect_hand),
        GuardedWriter(plc, has_heartbeat=True),
        journal,
        setpoints=tuple(points),
        respect_hand=respect_hand,
    )
    return Bench(clock, plc, store, journal, cycle)


def image_of(monotonic: float = 0.0, true_time: float | None = 1.7e9, **values: float) -> Image:
    """An image of good values."""
    return Image(monotonic, true_time, {name: Value(value, Quality.GOOD, 0.0) for name, value in values.items()})
