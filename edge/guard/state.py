"""What goes into the guard's decision, what comes out, and what it remembers from one cycle to the next."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from igrow.edge.guard.crop import CropMemory
from igrow.edge.guard.interlocks import Force


@dataclass(frozen=True, slots=True)
class Request:
    """What a source asks for at one point."""

    value: float
    source: str
    why: str = ""
    """For the ledger, where the source alone does not tell."""
    at_once: bool = False
    """Without slew: the point stood there already, and only something else moved it away."""


@dataclass(frozen=True, slots=True)
class Write:
    """A value to be written now."""

    point: str
    value: float
    requested: float | None
    source: str
    reason: str
    """Why the value differs from the request, or why there is a request at all where no source decides."""
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
    """crop, limit, interlock, slew, hand, manual, doubt, minimum_interval, budget or refused."""
    source: str


@dataclass(frozen=True, slots=True)
class PointState:
    """What the guard remembers about one point."""

    ramp: float | None = None
    written: float | None = None
    written_at: float = -math.inf
    budget: tuple[float, ...] = ()
    """When the writes of the last 24 h happened, oldest first; kept only for points with a budget."""
    taken: float | None = None
    """Where a point that no source decides stood before an interlock or a separating test took it."""
    taken_by: str = ""
    """The interlock's name, or `separating_test`."""


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


def never_sent(state: GuardState, before: GuardState, point: str) -> GuardState:
    """Return `state` as if the write to `point` had not been decided, since it certainly never left."""
    earlier = before.points.get(point, PointState())
    return _changed(state, point, replace(earlier, ramp=None))


def postponed(state: GuardState, before: GuardState, point: str) -> GuardState:
    """Return `state` with the write to `point` still to come: its ramp runs on meanwhile."""
    earlier = before.points.get(point, PointState())
    return _changed(state, point, replace(earlier, ramp=state.points[point].ramp))


def begin_again(state: GuardState, points: Collection[str]) -> GuardState:
    """Return `state` with the ramps of these points to begin where the PLC now stands (a fallback, a hand)."""
    return replace(state, points={n: replace(p, ramp=None) if n in points else p for n, p in state.points.items()})


def go_on(state: GuardState, stood: Mapping[str, float]) -> GuardState:
    """Return `state` with the ramps of these points to go on from where they stood (a PLC that was off)."""
    points = {name: replace(p, ramp=stood.get(name, p.ramp)) for name, p in state.points.items()}
    return replace(state, points=points)


def with_earlier_writes(state: GuardState, writes: Mapping[str, Sequence[float]]) -> GuardState:
    """Return `state` knowing the times of writes before this start, so that a restart frees no daily budget."""
    points = dict(state.points)
    for name, times in writes.items():
        points[name] = replace(points.get(name, PointState()), budget=tuple(sorted(times)))
    return replace(state, points=points)


def _changed(state: GuardState, point: str, memory: PointState) -> GuardState:
    return replace(state, points={**state.points, point: memory})
