"""The guard's decision as a pure function: what is asked for, what was written, what is measured -> what to write.

For each point, in this order:

1. a request that is no number is refused;
2. the crop's limits bring it to the nearest value that leaves none (`igrow.edge.guard.crop`);
3. absolute limits cut it;
4. slew lets a ramp run towards it;
5. interlocks force it between their bounds at once, the earlier interlock first, also when only the ramp, or what
   stands in the PLC, is outside them;
6. a change by hand at the PLC is left alone while it is respected (an interlock still comes first);
7. dead band, minimum interval and daily budget say whether this is the moment to write.

Invariants, tested with arbitrary input: a write never leaves the limits; two writes never differ by more than the
slew allows for the time between them, unless an interlock, the stop or a hand at the PLC moved the point in
between; no 24 h see more writes than the budget.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from igrow.edge.guard import crop
from igrow.edge.guard.crop import CropMemory
from igrow.edge.guard.interlocks import Force, evaluate
from igrow.edge.guard.rules import GuardRules, PointRule
from igrow.edge.image import Image

DAY = 86_400.0
LONGEST_RAMP = 900.0
"""A ramp never makes up for more than this many seconds at once, however long the daemon was away."""


@dataclass(frozen=True, slots=True)
class Request:
    """What a source asks for at one point."""

    value: float
    source: str


@dataclass(frozen=True, slots=True)
class Write:
    """A value to be written now."""

    point: str
    value: float
    requested: float | None
    source: str
    reason: str
    """Why the value differs from the request; empty when it does not."""
    urgent: bool = False
    """An interlock or the stop: these leave first."""


@dataclass(frozen=True, slots=True)
class Clamp:
    """The guard changed a request or held it back."""

    point: str
    requested: float | None
    applied: float | None
    """None when the request was refused or nothing may be written now."""
    reason: str
    kind: str
    """crop, limit, interlock, slew, hand, minimum_interval, budget or refused."""
    source: str


@dataclass(frozen=True, slots=True)
class PointState:
    """What the guard remembers about one point."""

    ramp: float | None = None
    written: float | None = None
    written_at: float = -math.inf
    budget: tuple[float, ...] = ()
    """When the writes of the last 24 h happened, oldest first; kept only for points with a budget."""


@dataclass(frozen=True, slots=True)
class GuardState:
    """What the guard remembers between two cycles."""

    points: Mapping[str, PointState] = field(default_factory=dict)
    engaged: frozenset[str] = frozenset()
    at: float | None = None
    """When it last decided."""
    crop: CropMemory = field(default_factory=CropMemory)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What to write, what was changed, and what to remember."""

    writes: tuple[Write, ...]
    clamps: tuple[Clamp, ...]
    state: GuardState
    engaged: tuple[Force, ...] = ()


@dataclass(slots=True)
class _Target:
    """Where a point should go, and what had to be changed on the way there."""

    value: float
    kind: str = ""
    reason: str = ""
    urgent: bool = False


def guard(
    requests: Mapping[str, Request],
    shown: Mapping[str, float | None],
    held: Mapping[str, float],
    image: Image,
    state: GuardState,
    rules: GuardRules,
    *,
    stopping: bool = False,
) -> Verdict:
    """Decide what to write now.

    `shown` is what stands in the PLC as far as we know (None: unknown); `held` maps points that somebody changed
    by hand to the seconds that this is still respected. With `stopping` every point goes to its safe value
    at once, without slew, dead band or interval, as the PLC's own fallback would do it.
    """
    now = image.monotonic
    forces, engaged = evaluate(rules.interlocks, image, state.engaged)
    passed = 0.0 if state.at is None else min(max(0.0, now - state.at), LONGEST_RAMP)
    writes: list[Write] = []
    clamps: list[Clamp] = []
    points: dict[str, PointState] = {}
    requests, had = _for_the_crop(requests, shown, image, state, rules, passed, clamps)
    for name, rule in rules.points.items():
        memory = state.points.get(name, PointState())
        request = Request(rule.safe, "stop") if stopping else requests.get(name)
        current = shown.get(name)
        if request is not None and not math.isfinite(request.value):
            clamps.append(Clamp(name, None, None, "the request is not a finite number", "refused", request.source))
            request = None
        point = _Point(name, rule, memory, current, now, passed)
        points[name] = point.decide(request, forces, held.get(name), stopping, writes, clamps)
    writes.sort(key=lambda write: not write.urgent)
    return Verdict(tuple(writes), tuple(clamps), GuardState(points, engaged, now, had), tuple(forces))


def _for_the_crop(
    requests: Mapping[str, Request],
    shown: Mapping[str, float | None],
    image: Image,
    state: GuardState,
    rules: GuardRules,
    passed: float,
    clamps: list[Clamp],
) -> tuple[Mapping[str, Request], CropMemory]:
    """Return the requests as the crop's limits leave them, and what the crop has had by now."""
    if rules.crop is None:
        return requests, state.crop
    standing = {name: shown.get(name) for name in rules.points}
    ramp = state.points.get("heating_setpoint", PointState()).ramp
    if ramp is not None:
        # The drift of the crop counts from where the ramp is, not from what was worth a write.
        standing["heating_setpoint"] = ramp
    had = crop.observed(rules.crop, state.crop, image, standing)
    asked = {
        name: request.value
        for name, request in requests.items()
        if request.source not in crop.EXEMPT and math.isfinite(request.value)
    }
    changed = dict(requests)
    for name, (value, reason) in crop.held(rules.crop, had, image.monotonic, passed, asked).items():
        changed[name] = replace(requests[name], value=value)
        clamps.append(Clamp(name, asked[name], value, reason, "crop", requests[name].source))
    return changed, had


def never_sent(state: GuardState, before: GuardState, point: str) -> GuardState:
    """Return `state` as if the write to `point` had not been decided, since it certainly never left."""
    earlier = before.points.get(point, PointState())
    restored = replace(earlier, ramp=None)
    return replace(state, points={**state.points, point: restored})


def begin_again(state: GuardState, points: Collection[str]) -> GuardState:
    """Return `state` with the ramps of these points to begin where the PLC now stands (a fallback, a hand)."""
    return replace(state, points={n: replace(p, ramp=None) if n in points else p for n, p in state.points.items()})


def with_earlier_writes(state: GuardState, writes: Mapping[str, Sequence[float]]) -> GuardState:
    """Return `state` knowing the times of writes before this start, so that a restart frees no daily budget."""
    points = dict(state.points)
    for name, times in writes.items():
        points[name] = replace(points.get(name, PointState()), budget=tuple(sorted(times)))
    return replace(state, points=points)


@dataclass(slots=True)
class _Bounds:
    """What limits and interlocks leave, and which interlock set each side."""

    low: float
    high: float
    low_by: Force | None = None
    high_by: Force | None = None


@dataclass(slots=True)
class _Point:
    """One point in one cycle."""

    name: str
    rule: PointRule
    memory: PointState
    current: float | None
    now: float
    passed: float

    def decide(
        self,
        request: Request | None,
        forces: list[Force],
        held: float | None,
        stopping: bool,
        writes: list[Write],
        clamps: list[Clamp],
    ) -> PointState:
        """Add to writes and clamps; return the point's new memory."""
        bounds = self._bounds(forces)
        if request is None or (held is not None and not stopping):
            # Nobody asks, or a hand asked last: the point stays as it is, unless an interlock forces it away.
            target = self._forced(_Target(self._standing()), bounds)
            if request is not None and not target.urgent:
                text = f"changed by hand at the PLC, respected for {(held or 0.0) / 60:.0f} min more"
                clamps.append(Clamp(self.name, request.value, self.current, text, "hand", request.source))
            if not target.urgent:
                return self._rested()
        else:
            target = self._limited(request.value)
            if not stopping:
                self._ramp(target)
            target = self._forced(target, bounds)
            target.urgent |= stopping
        requested = None if request is None else request.value
        source = "interlock" if request is None else request.source
        if target.kind:
            clamps.append(Clamp(self.name, requested, target.value, target.reason, target.kind, source))
        return self._written(target, requested, source, writes, clamps)

    def _standing(self) -> float:
        stands = self.current if self.current is not None else self.memory.written
        return stands if stands is not None and math.isfinite(stands) else self.rule.safe

    def _limited(self, value: float) -> _Target:
        if value < self.rule.low:
            return _Target(self.rule.low, "limit", f"below the limit of {self.rule.low:g}")
        if value > self.rule.high:
            return _Target(self.rule.high, "limit", f"above the limit of {self.rule.high:g}")
        return _Target(value)

    def _bounds(self, forces: list[Force]) -> _Bounds:
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
        if value != target.value and cause is not None:
            return _Target(value, "interlock", f"interlock {cause.name}: {cause.why}", urgent=True)
        stands = self._standing()
        cause = bounds.low_by if stands < bounds.low else bounds.high_by if stands > bounds.high else None
        if cause is not None and not self.rule.same(stands, value):
            return _Target(value, "interlock", f"interlock {cause.name}: {cause.why}", urgent=True)
        return _Target(value, target.kind, target.reason)

    def _ramp(self, target: _Target) -> None:
        """Move the target to where the slew lets the point be by now."""
        if self.rule.slew is None:
            return
        start, step = self._start(), self.rule.slew * self.passed
        value = min(max(target.value, start - step), start + step)
        if abs(value - target.value) > 1e-9:
            slew = f"slew of {3600 * self.rule.slew:g} per hour on the way to {target.value:g}"
            target.reason = f"{target.reason}; {slew}" if target.reason else slew
            target.kind = target.kind or "slew"
        target.value = value

    def _start(self) -> float:
        """Where the ramp stands: a value within the limits, taken from the PLC when we do not know better."""
        start = self.memory.ramp
        if start is None:
            start = self.current if self.current is not None and math.isfinite(self.current) else self.rule.safe
        return min(max(start, self.rule.low), self.rule.high)

    def _rested(self) -> PointState:
        """Nothing is asked of the point: the next ramp begins where the PLC then stands."""
        return replace(self.memory, ramp=self.current, budget=self._recent())

    def _recent(self) -> tuple[float, ...]:
        return tuple(at for at in self.memory.budget if self.now - at < DAY)

    def _written(
        self,
        target: _Target,
        requested: float | None,
        source: str,
        writes: list[Write],
        clamps: list[Clamp],
    ) -> PointState:
        """Write now, or say what stands against it."""
        rule, memory, budget, value = self.rule, self.memory, self._recent(), target.value
        waiting = PointState(value, memory.written, memory.written_at, budget)
        since = self.now - memory.written_at
        due = rule.refresh is not None and since >= rule.refresh
        if not due and self.current is not None and self._close_enough(value, self.current, target.urgent):
            return waiting
        if not target.urgent and since < rule.minimum_interval:
            text = f"written {since:.0f} s ago, at least {rule.minimum_interval:.0f} s apart"
            clamps.append(Clamp(self.name, requested, None, text, "minimum_interval", source))
            return waiting
        if rule.daily_budget is not None:
            left = rule.daily_budget - len(budget) - (0 if target.urgent else rule.reserve)
            if left <= 0:
                text = f"{len(budget)} of {rule.daily_budget} writes of the last 24 h are used"
                clamps.append(Clamp(self.name, requested, None, text, "budget", source))
                return waiting
            budget = (*budget, self.now)
        writes.append(Write(self.name, value, requested, source, target.reason, target.urgent))
        return PointState(value, value, self.now, budget)

    def _close_enough(self, value: float, current: float, urgent: bool) -> bool:
        if self.rule.same(value, current):
            return True
        # What stands in the PLC may lie outside our limits (a hand, a fallback): then no dead band excuses us.
        inside = self.rule.low <= current <= self.rule.high
        return inside and not urgent and abs(value - current) <= self.rule.dead_band
