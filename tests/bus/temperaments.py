"""Devices with the temperaments that PLCs and gateways have, beside what networks do to their answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import deepcopy

from igrow.edge.registers.codec import decode
from igrow.edge.registers.model import Function, RegisterMap
from igrow.edge.virtual_plc.memory import AnswerWithExceptionError
from tests.bus.plc_bench import RULES, RecordingUnit

DEVICE_FAILURE = 4


class MoodyUnit(RecordingUnit):
    """Its registers are its own; what it was told stands in `received`, whatever it makes of that."""

    def __init__(self, points: RegisterMap, device: str) -> None:
        self.ramps: dict[str, float] = {}
        """Change per second with which a register follows what was written."""
        self.takes_at: float | None = None
        """Writes are taken when so many seconds of the loop's time are full: 60 for the next minute."""
        self.shows_every: float | None = None
        """A gateway before it answers out of what it has read last; it reads all at once, so many seconds apart."""
        self.refuses: int | None = None
        """All is answered with this exception."""
        self.is_local = False
        """Writes are answered with "device failure"; the heartbeat is taken."""
        self.clears_heartbeat_every: float | None = None
        """It puts its heartbeat register to zero so often, and looks whether somebody writes it again."""
        self.highest_beat = math.inf
        """Where its heartbeat register ends."""
        self.deaf_for: dict[str, float] = {}
        """Seconds after a write to a point in which it takes no other one to that point."""
        self.at_write: Callable[[str], None] = lambda name: None
        """What happens when a point was written."""
        self.frozen = False
        """A gateway before it answers out of its memory and confirms each write; the unit hears nothing."""
        self._due: dict[str, tuple[float, float]] = {}
        self._aims: dict[str, float] = {}
        self._taken: dict[str, float] = {}
        self._ready = False
        super().__init__(points, device)
        self._last = self._refreshed = self._cleared = self._changed = self.loop.time()
        self._memory = deepcopy(self.tables)
        self._ready = True

    # what time does

    def _advance(self) -> None:
        now = self.loop.time()
        since, self._last = now - self._last, now
        for name, (at, value) in list(self._due.items()):
            if at <= now and self._due.pop(name, None) is not None:
                self._take(name, value)
        for name, aim in list(self._aims.items()):
            stands = super().value(name) or 0.0
            step = self.ramps[name] * since
            super().set_value(name, stands + min(max(aim - stands, -step), step))
        every = self.clears_heartbeat_every
        if every is not None and "heartbeat" in self.points and now - self._cleared >= every:
            self._cleared = now
            super().set_value("heartbeat", 0.0)
        if self.shows_every is not None and now - self._refreshed >= self.shows_every:
            self._refreshed, self._memory = now, deepcopy(self.tables)

    # what clients do

    def read(self, function: Function, address: int, count: int) -> list[int]:
        self._advance()
        if self.refuses is not None:
            raise AnswerWithExceptionError(self.refuses)
        tables = self.tables if self.shows_every is None and not self.frozen else self._memory
        return tables[function].read(address, count)

    def write(self, function: Function, address: int, values: Sequence[int]) -> None:
        self._advance()
        name = next(n for n, p in self.points.items() if (p.function, p.address) == (function, address))
        if self.refuses is not None:
            raise AnswerWithExceptionError(self.refuses)
        if self.is_local and name != "heartbeat":
            raise AnswerWithExceptionError(DEVICE_FAILURE)
        value = decode(self.points[name], tuple(values))
        assert value is not None
        if self.frozen:
            assert name not in RULES or RULES[name].low <= value <= RULES[name].high
            return
        self.received.setdefault(name, []).append((self.loop.time(), value))
        if self.loop.time() - self._taken.get(name, -math.inf) >= self.deaf_for.get(name, 0.0):
            self._taken[name] = self.loop.time()
            if self.takes_at is not None and name in RULES:
                self._due[name] = (math.ceil(self.loop.time() / self.takes_at) * self.takes_at, value)
            else:
                self._take(name, value)
        self.at_write(name)

    def _take(self, name: str, value: float) -> None:
        if name == "heartbeat":
            value = min(value, self.highest_beat)
            self._changed = self._changed if value == super().value(name) else self.loop.time()
        value = self.makes.get(name, lambda same: same)(value)
        if name in self.ramps:
            self._aims[name] = value
        else:
            super().set_value(name, value)

    # what the PLC, or somebody at it, does

    def value(self, name: str) -> float | None:
        self._advance()
        return super().value(name)

    def set_value(self, name: str, value: float) -> None:
        if self._ready:
            self._advance()
            self._due.pop(name, None)
            self._aims.pop(name, None)
        super().set_value(name, value)

    def freeze(self) -> None:
        """From now on a gateway answers for it."""
        self._advance()
        self.frozen, self._memory = True, deepcopy(self.tables)

    def beaten_at(self) -> float | None:
        return self._changed if self.received.get("heartbeat") else None
