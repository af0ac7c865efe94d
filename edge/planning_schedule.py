"""When a plan is asked for, and from what: each K1, and only from an image that may be believed.

A plan is asked for before it begins, so that it is ready when the one before it ends. What touches a disk (the log, the
forecast) is left to the planning service, so that no cycle waits for it.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from pathlib import Path
from zoneinfo import ZoneInfo

from igrow.core.co2_count import CO2Count
from igrow.core.errors import IgrowError
from igrow.edge.image import Image
from igrow.edge.ports import ActiveBundle, PlanningService, PlanRequest, Store
from igrow.edge.sensors.consequences import usable_for_planning
from igrow.edge.sources.recipe import Recipe, recipe_course

ESSENTIAL = ("air_temperature", "air_humidity", "air_co2")
"""Where a plan starts from. While one that the plant measures cannot be believed, no new plan is made."""
FIRST_PLAN_WAITS = "the first plan needs a day of log"
"""How the problem begins that is none: planning waits for its log."""
LEAST_HISTORY = 24 * 3600.0
"""Seconds of log that a plan needs: its weather is that of the last days."""
RETRY = 900.0
"""Seconds after a failed plan until the next is tried."""
LEAD = 2 * RETRY
"""Seconds before its beginning that a plan is asked for, so that one may fail; at most half of the pace."""
CLOCK_MOVED = 600.0
"""Seconds by which a date may move against the monotonic clock before a plan that was dated by it is made anew."""


@dataclass(frozen=True)
class PlanningRules:
    """Pace and horizon, in seconds."""

    every: float
    horizon: float
    step: float
    history: float
    seed: int
    forecast: Path | None = None


class PlanningSchedule:
    """Asks for plans; says in one line why none is asked for."""

    def __init__(
        self, rules: PlanningRules, service: PlanningService, store: Store, recipe: Recipe, zone: ZoneInfo
    ) -> None:
        self._rules = rules
        self._service = service
        self._store = store
        self._recipe = recipe
        self._zone = zone
        self._due = self._young_until = -math.inf
        self._offset: float | None = None
        self._asked: float | None = None
        """Seconds since 1970 UTC at which the plan that was last asked for begins."""
        self._next: float | None = None
        """Seconds since 1970 UTC at which the next plan is to begin."""
        self._requests = 0
        self.problem = ""

    def tick(self, image: Image, bundle: ActiveBundle | None) -> bool:
        """Ask for a plan when one is due; tell whether one was asked for. Never blocks."""
        if image.true_time is None:
            self.problem = "no plans while the clock is wrong"
            return False
        self._watch_clock(image.true_time - image.monotonic)
        if image.monotonic < self._due or self._service.busy:
            return False
        self.problem = self._obstacle(image, bundle)
        if self.problem or bundle is None:
            return False
        start = self._start(image.true_time)
        self._asked, self._next = start, start + self._rules.every
        self._due = image.monotonic + (self._next - self._lead - image.true_time)
        seed = self._rules.seed + self._requests
        self._requests += 1
        self._service.request(functools.partial(self._prepare, image.monotonic, image.true_time, start, bundle, seed))
        return True

    def retry_soon(self, monotonic: float) -> None:
        """Ask again before the next K1, since the last plan failed."""
        self._due = min(self._due, monotonic + RETRY)

    @property
    def _lead(self) -> float:
        return min(LEAD, 0.5 * self._rules.every)

    def _start(self, now: float) -> float:
        """Return when a plan that is asked for now begins."""
        for begins in (self._asked, self._next):
            if begins is not None and now <= begins <= now + self._lead:
                return begins
        return now - now % self._rules.step

    def _watch_clock(self, offset: float) -> None:
        """Forget what was dated by a clock that has been set since (`offset`: date minus monotonic seconds)."""
        if self._offset is not None and abs(offset - self._offset) > CLOCK_MOVED:
            self._due = self._young_until = -math.inf
            self._asked = self._next = None
        self._offset = offset

    def _obstacle(self, image: Image, bundle: ActiveBundle | None) -> str:
        if bundle is None:
            return "no plans without a bundle"
        for name in ESSENTIAL:
            if name in image.values and usable_for_planning(image.values[name]) is None:
                return f"no new plan while {name} is {image.values[name].quality.value}"
        missing = self._young_until - image.monotonic
        return f"{FIRST_PLAN_WAITS}: {missing / 3600:.0f} h more" if missing > 0 else ""

    def _prepare(
        self, monotonic: float, now: float, start: float, bundle: ActiveBundle, seed: int
    ) -> PlanRequest | None:
        """Return what a plan is made from, None while the log is too young (in the service's own thread)."""
        rules = self._rules
        telemetry = self._store.telemetry(now - rules.history, now + 1.0)
        first = float(telemetry.time[0].astype("datetime64[s]").astype(float)) if len(telemetry) else now
        if now - first < LEAST_HISTORY:
            self._young_until = monotonic + LEAST_HISTORY - (now - first)
            self._due, self._asked, self._next = -math.inf, None, None
            return None
        steps = max(1, round(rules.horizon / rules.step))
        return PlanRequest(
            time=start,
            step_seconds=rules.step,
            telemetry=telemetry,
            recipe=recipe_course(self._recipe, self._zone, start, rules.step, steps),
            bundle=bundle.folder,
            forecast=rules.forecast,
            seed=seed,
            co2_counted=self._co2_counted(),
        )

    def _co2_counted(self) -> CO2Count | None:
        """Return what the newest plan has written down of the CO2 before it, also one of an earlier run."""
        try:
            return CO2Count.of_plan(self._store.newest_event("plan"))
        except IgrowError:
            # A ledger that cannot be read says so in the store's health; it does not cost the plan.
            return None
