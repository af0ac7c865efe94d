"""A PLC with a will of its own, of one or several units: what real ones do to what is written to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from igrow.edge.bus.errors import AddressRefusedError, NoAnswerError, NoValueError
from igrow.edge.bus.plc import Reading
from igrow.edge.cycle import ControlCycle
from igrow.edge.guard import GuardedWriter, GuardRules, Interlock, PointRule, Readback
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.image import Image
from igrow.edge.journal import Journal
from igrow.edge.sensors import ImageBuilder, SensorRule
from igrow.edge.sources import HandsOff, Source
from tests.control.control_fakes import READ_AGAIN, Bench, FakePlc, MemoryStore
from tests.fake_clock import FakeClock

SAFE = {"heating_setpoint": 18.0, "co2_setpoint": 400.0, "lamp_on": 0.0, "irrigation_on": 0.1}
RULES: Mapping[str, PointRule] = {
    "heating_setpoint": PointRule(low=12.0, high=28.0, safe=18.0, dead_band=0.1),
    "co2_setpoint": PointRule(low=400.0, high=1000.0, safe=400.0, dead_band=10.0),
    "lamp_on": PointRule(low=0.0, high=1.0, safe=0.0, dead_band=0.05),
    "irrigation_on": PointRule(low=0.0, high=1.0, safe=0.1, dead_band=0.02),
}
SENSORS = {"air_temperature": 20.0, "air_co2": 600.0, "wind_speed": 3.0}


class StubbornPlc(FakePlc):
    """Registers in units, with the manners of real devices."""

    def __init__(self, clock: FakeClock, values: Mapping[str, float], units: Mapping[str, str] | None = None) -> None:
        super().__init__(clock, values)
        self.units = dict(units or {})
        self.down: set[str] = set()
        """Units that do not answer."""
        self.unreadable: set[str] = set()
        self.polls: dict[str, float] = {}
        self.makes: dict[str, Callable[[float], float]] = {}
        """What the device makes of a value: its limits, its resolution."""
        self.takes: dict[str, float] = {}
        """Seconds until a written value is in the register."""
        self.ramps: dict[str, float] = {}
        """Change per second with which a register follows what was written."""
        self.swapped: dict[str, str] = {}
        self.fallback_after: float | None = None
        """Seconds without our heartbeat, or in a unit without that register without any request, until a unit puts
        its safe values into its registers."""
        self._heard_at: dict[str, float] = {}
        self._due: dict[str, float] = {}
        self._coming: list[tuple[float, str, float]] = []
        self._aims: dict[str, float] = {}

    def unit_of(self, name: str) -> str:
        return self.units.get(name, "")

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, Reading]:
        self.clock.advance(0.0 if names is None else READ_AGAIN)
        now = self.clock.monotonic()
        wanted = [name for name in self.values if self._is_due(name, now)] if names is None else names
        return {name: self._reading(name, now) for name in wanted}

    def _is_due(self, name: str, now: float) -> bool:
        if now < self._due.get(name, now):
            return False
        self._due[name] = now + self.polls.get(name, 0.0)
        return True

    def _reading(self, name: str, now: float) -> Reading:
        if self.silent or self.unit_of(name) in self.down:
            return Reading(None, NoAnswerError("no answer"), now)
        self._hear(name)
        if name in self.unreadable:
            return Reading(None, AddressRefusedError("illegal data address", 2), now)
        value = self.values[name]
        if not math.isfinite(value):
            return Reading(None, NoValueError(f"{name}: the device says that it has no value"), now)
        return Reading(value, None, now)

    async def write(self, name: str, value: float) -> None:
        if self.write_error is not None:
            raise self.write_error
        if self.silent or self.unit_of(name) in self.down:
            raise NoAnswerError("no answer")
        self.writes.append((self.clock.monotonic(), name, value))
        if name in self.ignores:
            return
        self._hear(name, beat=name == "heartbeat")
        name = self.swapped.get(name, name)
        value = self.makes.get(name, lambda same: same)(value)
        if name in self.ramps:
            self._aims[name] = value
        elif name in self.takes:
            self._coming.append((self.clock.monotonic() + self.takes[name], name, value))
        else:
            self.values[name] = value

    def _hear(self, name: str, *, beat: bool = False) -> None:
        unit = self.unit_of(name)
        if beat or unit != self.unit_of("heartbeat") or "heartbeat" not in self.values:
            self._heard_at[unit] = self.clock.monotonic()
            if beat and "plc_fallback" in self.values:
                self.values["plc_fallback"] = 0.0

    def by_hand(self, name: str, value: float) -> None:
        """Somebody at the panel; what was still to come is off."""
        self._coming = [entry for entry in self._coming if entry[1] != name]
        self._aims.pop(name, None)
        self.values[name] = value

    def power_up(self, values: Mapping[str, float], *, heartbeat: bool = True) -> None:
        """Start anew with these values; `heartbeat` tells whether that register is cleared as well."""
        self._coming = [entry for entry in self._coming if entry[1] not in values]
        for name in values:
            self._aims.pop(name, None)
        self.values |= values
        if heartbeat:
            self.values["heartbeat"] = 0.0

    def advance(self, seconds: float) -> None:
        """Let time pass in the PLC; the clock was moved already."""
        now = self.clock.monotonic()
        for entry in [entry for entry in self._coming if entry[0] <= now]:
            self._coming.remove(entry)
            self.values[entry[1]] = entry[2]
        for name, aim in self._aims.items():
            step = self.ramps[name] * seconds
            self.values[name] += min(max(aim - self.values[name], -step), step)
        if self.fallback_after is None:
            return
        for unit in {self.unit_of(name) for name in self.values}:
            if now - self._heard_at.setdefault(unit, now) > self.fallback_after:
                self._fall_back({name for name in SAFE if name in self.values and self.unit_of(name) == unit})
                if "plc_fallback" in self.values and self.unit_of("plc_fallback") == unit:
                    self.values["plc_fallback"] = 1.0

    def _fall_back(self, names: Collection[str]) -> None:
        self._coming = [entry for entry in self._coming if entry[1] not in names]
        for name in names:
            self._aims.pop(name, None)
            self.values[name] = SAFE[name]


@dataclass
class Notes:
    """Keeps the newest of what a restart must not forget."""

    content: Mapping[str, object] = field(default_factory=dict)
    at: float = 0.0

    def keep(self, image: Image, content: Mapping[str, object]) -> None:
        self.content, self.at = content, image.monotonic


@dataclass
class StubbornBench(Bench):
    """A cycle on such a PLC, which can be ended and begun anew."""

    plc: StubbornPlc
    build: Callable[[], ControlCycle]
    notes: Notes

    async def run(self, cycles: int = 1, seconds: float = 10.0) -> None:
        for _ in range(cycles):
            self.clock.advance(seconds)
            self.plc.advance(seconds)
            self.result = await self.cycle.run()

    def pass_time(self, seconds: float) -> None:
        """Let time pass with no daemon there."""
        self.clock.advance(seconds)
        self.plc.advance(seconds)

    def restart(self, respect_hand: float = 7200.0) -> None:
        """A new process that knows what the old one noted."""
        away = self.clock.monotonic() - self.notes.at
        self.cycle = self.build()
        self.cycle.recall(
            self.notes.content, 0.0, same={*self.cycle.readback.points, HEARTBEAT}, agree=away <= respect_hand
        )

    def events(self, kind: str) -> list[Mapping[str, Any]]:
        return [detail for name, detail in self.store.events if name == kind]

    @property
    def alarms(self) -> dict[str, str]:
        return {alarm.name: alarm.text for alarm in self.journal.alarms.active}


def make_stubborn_bench(
    source: Source,
    *,
    values: Mapping[str, float] | None = None,
    rules: Mapping[str, PointRule] = RULES,
    decided: Collection[str] | None = None,
    units: Mapping[str, str] | None = None,
    interlocks: tuple[Interlock, ...] = (),
    sensors: Mapping[str, SensorRule] | None = None,
    respect_hand: float = 7200.0,
    heartbeat: bool = True,
    interval: float = 10.0,
) -> StubbornBench:
    """`decided` are the points that sources decide, all of `rules` by default; `interval` the pace of the cycles."""
    clock = FakeClock(1000.0)
    setpoints = tuple(rules if decided is None else decided)
    registers = {**SENSORS, **{name: rule.safe for name, rule in rules.items()}}
    registers |= {"heartbeat": 0.0} if heartbeat else {}
    plc = StubbornPlc(clock, registers | dict(values or {}), units)
    store, notes = MemoryStore(), Notes()
    journal = Journal(store)
    judged = {name: SensorRule(-1e6, 1e6, stale_after=30.0) for name in plc.values} | dict(sensors or {})

    def build() -> ControlCycle:
        return ControlCycle(
            plc,
            clock,
            ImageBuilder(judged, units=plc.units),
            [source, HandsOff({name: rules[name].safe for name in setpoints})],
            GuardRules(rules, interlocks),
            Readback(
                rules,
                confirm_within=max(60.0, 3.0 * interval),
                respect_hand=respect_hand,
                silence=3.0 * interval,
                units=plc.units,
            ),
            GuardedWriter(plc, has_heartbeat=heartbeat),
            journal,
            setpoints=setpoints,
            respect_hand=respect_hand,
            keep=notes.keep,
        )

    return StubbornBench(clock, plc, store, journal, build(), build, notes)
