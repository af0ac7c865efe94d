"""Following a plan: which of its steps is now, and how long it may be followed.

Plans are dated, clocks may jump. A plan is therefore tied to the daemon's monotonic clock at the moment it
arrives, and followed on that clock from then on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from igrow.edge.image import Image
from igrow.edge.ports import Plan
from igrow.edge.sources.decision import Offer


@dataclass(frozen=True, slots=True)
class _Anchored:
    plan: Plan
    offset: float
    """Seconds since 1970 UTC minus monotonic seconds when the plan arrived."""

    def now(self, monotonic: float) -> float:
        return monotonic + self.offset


class PlanKeeper:
    """Takes plans from where they are made and ties them to the monotonic clock.

    A plan is made before it begins; until then the one before it is followed.
    """

    def __init__(self, latest: Callable[[], Plan | None]) -> None:
        self._latest = latest
        self._anchored: _Anchored | None = None
        self._coming: _Anchored | None = None

    def anchored(self, image: Image) -> _Anchored | None:
        """Return the newest plan that could be tied to the clock and has begun; else the first that will."""
        plan = self._latest()
        newest = self._coming or self._anchored
        is_new = plan is not None and (newest is None or newest.plan is not plan)
        if is_new and plan is not None and image.true_time is not None:
            self._coming = _Anchored(plan, image.true_time - image.monotonic)
        coming = self._coming
        if coming is not None and (self._anchored is None or coming.now(image.monotonic) >= coming.plan.start):
            self._anchored, self._coming = coming, None
        return self._anchored

    @property
    def plan(self) -> Plan | None:
        """The plan that is followed, or was last."""
        return self._anchored.plan if self._anchored else None


def _step_of(plan: Plan, now: float) -> int | None:
    step = int((now - plan.start) // plan.step_seconds)
    steps = min((len(course) for course in plan.setpoints.values()), default=0)
    return step if 0 <= step < steps and now < plan.valid_until else None


def _at(plan: Plan, step: int) -> dict[str, float]:
    return {name: course[step] for name, course in plan.setpoints.items()}


def _clock(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).strftime("%d %b %H:%M UTC")


class FreshPlan:
    """Offers the newest plan while a newer one is not overdue."""

    name = "plan"

    def __init__(self, keeper: PlanKeeper, fresh_for: float) -> None:
        """`fresh_for` in seconds from the plan's start: the pace of planning with some slack."""
        self._keeper = keeper
        self._fresh_for = fresh_for

    def offer(self, image: Image) -> Offer:
        """Return the setpoints of the plan's present step."""
        anchored = self._keeper.anchored(image)
        if anchored is None:
            return Offer("no plan has been made")
        plan, now = anchored.plan, anchored.now(image.monotonic)
        step = _step_of(plan, now)
        if step is None:
            return Offer(
                f"the plan of {_clock(plan.start)} has expired" if now >= plan.start else "the plan is not due"
            )
        if now - plan.start > self._fresh_for:
            return Offer(f"a plan newer than {_clock(plan.start)} is overdue")
        return Offer(f"the plan of {_clock(plan.start)}", _at(plan, step))


class LastValidPlan:
    """Offers the newest plan for as long as it is valid, however overdue the next one is."""

    name = "last_plan"

    def __init__(self, keeper: PlanKeeper) -> None:
        self._keeper = keeper

    def offer(self, image: Image) -> Offer:
        """Return the setpoints of the plan's present step."""
        anchored = self._keeper.anchored(image)
        if anchored is None:
            return Offer("")
        plan = anchored.plan
        step = _step_of(plan, anchored.now(image.monotonic))
        if step is None:
            return Offer("")
        return Offer(f"the last valid plan, of {_clock(plan.start)}, until {_clock(plan.valid_until)}", _at(plan, step))
