"""One point in one cycle: from a request to a write, a clamp, or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from igrow.core.quantities import difference_with_unit, with_unit
from igrow.core.separating_tests.definition import SOURCE
from igrow.edge.guard.interlocks import Force
from igrow.edge.guard.rules import PointRule
from igrow.edge.guard.state import Clamp, PointState, Request, Write

DAY = 86_400.0


@dataclass(frozen=True, slots=True)
class Standstill:
    """Why a point is to stay where it is, whatever a source asks for; interlocks still move it."""

    kind: str
    """The kind of the clamp: hand or doubt."""
    why: str


@dataclass(slots=True)
class _Target:
    """Where a point should go, and what had to be changed on the way there."""

    value: float
    kind: str = ""
    reason: str = ""
    urgent: bool = False
    by: str = ""
    """The interlock that forces it there."""


@dataclass(slots=True)
class _Bounds:
    """What limits and interlocks leave, and which interlock set each side."""

    low: float
    high: float
    low_by: Force | None = None
    high_by: Force | None = None


@dataclass(slots=True)
class PointInCycle:
    """Decides for one point; adds to `writes` and `clamps`."""

    name: str
    rule: PointRule
    memory: PointState
    current: float | None
    now: float
    passed: float
    writes: list[Write]
    clamps: list[Clamp]

    def decide(
        self, request: Request | None, forces: Sequence[Force], standstill: Standstill | None, *, stopping: bool
    ) -> PointState:
        """Return the point's new memory."""
        takes = request is None or not self.rule.decided
        if request is None:
            request = self._giving_back()
        bounds = self._bounds(forces)
        if request is None or standstill is not None:
            target = self._forced(_Target(self._standing()), bounds)
            if request is not None and standstill is not None and not target.urgent:
                self._clamp(request, self.current, standstill.why, standstill.kind)
            if not target.urgent:
                return self._rested()
        else:
            target = self._limited(request.value)
            if not stopping and not request.at_once:
                self._ramp(target)
            target = self._forced(target, bounds)
            target.urgent |= stopping
        if target.kind:
            self._clamp(request, target.value, target.reason, target.kind)
        state = self._written(target, request)
        by = target.by or (SOURCE if request is not None and request.source == SOURCE else "")
        return self._noting_what_was_taken(state, by) if takes else state

    def left_alone(self, request: Request | None, why: str) -> PointState:
        """Return the point's new memory where nothing at all may be written."""
        if request is not None:
            self._clamp(request, self.current, why, "manual")
        return self._rested()

    # what is taken is given back

    def _noting_what_was_taken(self, state: PointState, by: str) -> PointState:
        """A point that nobody asks for would stay where an interlock or a test has put it: note what was taken."""
        if state.taken is not None or not by:
            return state
        return replace(state, taken=self._standing(), taken_by=by)

    def _giving_back(self) -> Request | None:
        """Ask for what was taken; forget it when it is back, or when the PLC has moved the point itself."""
        taken, by, written = self.memory.taken, self.memory.taken_by, self.memory.written
        if taken is None:
            return None
        current = self.current
        if current is not None and written is not None and not self._near(current, written):
            self.memory = replace(self.memory, taken=None, taken_by="")
            return None
        if current is not None and self._near(current, taken):
            self.memory = replace(self.memory, taken=None, taken_by="")
            return None
        back = with_unit(self.name, taken)
        if by == SOURCE:
            return Request(taken, SOURCE, f"back to {back}, where it stood before the separating test")
        return Request(taken, "interlock", f"back to {back}, where it stood before interlock {by} took it")

    # where to

    def _standing(self) -> float:
        stands = self.current if self.current is not None else self.memory.written
        return stands if stands is not None and math.isfinite(stands) else self.rule.safe

    def _limited(self, value: float) -> _Target:
        if value < self.rule.low:
            return _Target(self.rule.low, "limit", f"below the limit of {with_unit(self.name, self.rule.low)}")
        if value > self.rule.high:
            return _Target(self.rule.high, "limit", f"above the limit of {with_unit(self.name, self.rule.high)}")
        return _Target(value)

    def _bounds(self, forces: Sequence[Force]) -> _Bounds:
        bounds = _Bounds(self.rule.low, self.rule.high)
        for force in forces:
            bound = force.bounds.get(self.name)
            if bound is None:
                continue
            low, high = bound.limits(self.rule.safe)
            # Later interlocks may only narrow what earlier ones left.
            if low > bounds.low:
                bounds.low, bounds.low_by = min(low, bounds.high), force
            if high < bounds.high:
                bounds.high, bounds.high_by = max(high, bounds.low), force
        return bounds

    def _forced(self, target: _Target, bounds: _Bounds) -> _Target:
        """Bring the target between the bounds; it is urgent when it, or what stands in the PLC, is not there."""
        value = min(max(target.value, bounds.low), bounds.high)
        cause = bounds.low_by if value > target.value else bounds.high_by
        if value == target.value or cause is None:
            stands = self._standing()
            cause = bounds.low_by if stands < bounds.low else bounds.high_by if stands > bounds.high else None
            if cause is None or self.rule.same(stands, value):
                return _Target(value, target.kind, target.reason)
        reason = f"interlock {cause.name}: {cause.why}"
        return _Target(value, "interlock", reason, urgent=True, by=cause.name)

    def _ramp(self, target: _Target) -> None:
        """Move the target to where the slew lets the point be by now."""
        if self.rule.slew is None:
            return
        start, step = self._start(), self.rule.slew * self.passed
        value = min(max(target.value, start - step), start + step)
        if abs(value - target.value) > 1e-9:
            change, goal = difference_with_unit(self.name, 3600 * self.rule.slew), with_unit(self.name, target.value)
            slew = f"slew of {change} per hour on the way to {goal}"
            target.reason = f"{target.reason}; {slew}" if target.reason else slew
            target.kind = target.kind or "slew"
        target.value = value

    def _start(self) -> float:
        """Where the ramp stands: a value within the limits, taken from the PLC when we do not know better."""
        start = self.memory.ramp
        if start is None:
            start = self._standing()
        return min(max(start, self.rule.low), self.rule.high)

    # whether now

    def _rested(self) -> PointState:
        """Nothing is asked of the point: the next ramp begins where the PLC then stands."""
        return replace(self.memory, ramp=self.current, budget=self._recent())

    def _recent(self) -> tuple[float, ...]:
        return tuple(at for at in self.memory.budget if self.now - at < DAY)

    def _written(self, target: _Target, request: Request | None) -> PointState:
        """Write now, or say what stands against it."""
        rule, memory, budget, value = self.rule, self.memory, self._recent(), target.value
        waiting = replace(memory, ramp=value, budget=budget)
        since = self.now - memory.written_at
        due = rule.refresh is not None and since >= rule.refresh
        if not due and self.current is not None and self._close_enough(value, self.current, target.urgent):
            return waiting
        if not target.urgent and since < rule.minimum_interval:
            text = f"written {since:.0f} s ago, at least {rule.minimum_interval:.0f} s apart"
            self._clamp(request, None, text, "minimum_interval")
            return waiting
        if rule.daily_budget is not None:
            left = rule.daily_budget - len(budget) - (0 if target.urgent else rule.reserve)
            if left <= 0:
                text = f"{len(budget)} of {rule.daily_budget} writes of the last 24 h are used"
                self._clamp(request, None, text, "budget")
                return waiting
            budget = (*budget, self.now)
        asked, source = _asked(request)
        reason = target.reason or ("" if request is None else request.why)
        self.writes.append(Write(self.name, value, asked, source, reason, target.urgent))
        return replace(memory, ramp=value, written=value, written_at=self.now, budget=budget)

    def _close_enough(self, value: float, current: float, urgent: bool) -> bool:
        if self.rule.same(value, current):
            return True
        # What stands in the PLC may lie outside our limits (a hand, a fallback): then no dead band excuses us.
        inside = self.rule.low <= current <= self.rule.high
        return inside and not urgent and abs(value - current) <= self.rule.dead_band

    def _near(self, a: float, b: float) -> bool:
        return self.rule.same(a, b) or abs(a - b) <= self.rule.dead_band

    def _clamp(self, request: Request | None, applied: float | None, reason: str, kind: str) -> None:
        asked, source = _asked(request)
        self.clamps.append(Clamp(self.name, asked, applied, reason, kind, source))


def _asked(request: Request | None) -> tuple[float | None, str]:
    return (None, "interlock") if request is None else (request.value, request.source)
