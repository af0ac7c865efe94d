"""What stands in the PLC: confirms our writes by a later read, and notices hands that changed a setpoint there.

A write counts only when a reading taken after it shows the value. A reading that shows something else than what
was agreed before means that somebody changed it at the PLC; that is respected for a configured time. The PLC's own
fallback to safe setpoints, after we were silent for too long, is told apart by its register or by the silence.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from igrow.edge.guard.core import Write
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality, Value


class Outcome(Enum):
    """What a look at the PLC showed."""

    CONFIRMED = "confirmed"
    UNCONFIRMED = "unconfirmed"
    BY_HAND = "by_hand"
    FALLBACK = "fallback"
    HAND_ENDED = "hand_ended"


@dataclass(frozen=True, slots=True)
class Finding:
    """One outcome at one point."""

    point: str
    outcome: Outcome
    expected: float | None
    shown: float | None
    source: str = ""


@dataclass(slots=True)
class _Memory:
    agreed: float | None = None
    """What the PLC showed when we last agreed with it."""
    pending: Write | None = None
    pending_at: float = -math.inf
    held_until: float = -math.inf


class Readback:
    """Remembers per point what was agreed, what is still to be confirmed and what is held by a hand."""

    def __init__(self, rules: Mapping[str, PointRule], *, confirm_within: float, respect_hand: float) -> None:
        """`confirm_within` and `respect_hand` in seconds."""
        self._rules = rules
        self._confirm_within = confirm_within
        self._respect_hand = respect_hand
        self._points = {name: _Memory() for name in rules}
        self._silent = False
        self._in_fallback = False

    def wrote(self, write: Write, now: float) -> None:
        """Remember a write that may have reached the PLC; a later reading must show it."""
        memory = self._points[write.point]
        memory.pending, memory.pending_at = write, now

    def restore_hold(self, point: str, seconds: float) -> None:
        """Respect a hand that was noticed before a restart for so many seconds more (with a clock at 0)."""
        if point in self._points:
            self._points[point].held_until = seconds

    def held(self, now: float) -> dict[str, float]:
        """Return the seconds that each point changed by hand is still respected."""
        return {name: m.held_until - now for name, m in self._points.items() if m.held_until > now}

    def shown(self) -> dict[str, float | None]:
        """Return what stands in the PLC as far as we know: a write on its way counts until a read denies it."""
        result: dict[str, float | None] = {}
        for name, memory in self._points.items():
            result[name] = memory.pending.value if memory.pending is not None else memory.agreed
        return result

    def observe(self, image: Image) -> list[Finding]:
        """Compare an image with what was written; call once in each cycle, before deciding."""
        now = image.monotonic
        if not image.link_ok:
            self._silent = True
            return list(self._ended(now))
        silent, self._silent = self._silent, False
        self._in_fallback = _is_set(image.value_of("plc_fallback"))
        findings: list[Finding] = []
        for name, memory in self._points.items():
            value = image.value_of(name)
            if value.value is None or value.quality in (Quality.MISSING, Quality.STALE):
                findings.extend(self._overdue(name, memory, now, None))
            else:
                findings.extend(self._compare(name, memory, value.value, now - value.age, now, silent))
        findings.extend(self._ended(now))
        return findings

    def _ended(self, now: float) -> Iterable[Finding]:
        for name, memory in self._points.items():
            if memory.held_until <= now and memory.held_until > -math.inf:
                memory.held_until = -math.inf
                yield Finding(name, Outcome.HAND_ENDED, None, memory.agreed)

    def _compare(
        self, name: str, memory: _Memory, shown: float, read_at: float, now: float, silent: bool
    ) -> Iterable[Finding]:
        rule, pending = self._rules[name], memory.pending
        if pending is not None:
            if read_at <= memory.pending_at:
                return self._overdue(name, memory, now, None)
            if _matches(rule, shown, pending.value):
                memory.agreed, memory.pending = pending.value, None
                return [Finding(name, Outcome.CONFIRMED, pending.value, shown, pending.source)]
            if memory.agreed is None or _matches(rule, shown, memory.agreed):
                return self._overdue(name, memory, now, shown)
            memory.pending = None
        elif memory.agreed is None:
            memory.agreed = shown
            return []
        elif _matches(rule, shown, memory.agreed):
            return []
        expected, memory.agreed = pending.value if pending else memory.agreed, shown
        if self._in_fallback or (silent and _matches(rule, shown, rule.safe)):
            return [Finding(name, Outcome.FALLBACK, expected, shown)]
        memory.held_until = now + self._respect_hand
        return [Finding(name, Outcome.BY_HAND, expected, shown)]

    def _overdue(self, name: str, memory: _Memory, now: float, shown: float | None) -> list[Finding]:
        pending = memory.pending
        if pending is None or now - memory.pending_at <= self._confirm_within:
            return []
        memory.pending = None
        memory.agreed = shown
        return [Finding(name, Outcome.UNCONFIRMED, pending.value, shown, pending.source)]


def _matches(rule: PointRule, shown: float, value: float) -> bool:
    return rule.same(shown, value) or abs(shown - value) <= rule.dead_band


def _is_set(value: Value) -> bool:
    return value.quality is Quality.GOOD and value.value is not None and value.value >= 0.5
