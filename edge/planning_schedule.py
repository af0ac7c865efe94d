"""When a plan is asked for, and from what: each K1, and only from an image that may be believed.

A plan is asked for before it begins, so that it is ready when the one before it ends.
"""

from __future__ import annotations

import asyncio
import logging
from dataclasses import dataclass
from pathlib import Path
from zoneinfo import ZoneInfo

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry
from igrow.edge.image import Image
from igrow.edge.planning.open_meteo import read_forecast
from igrow.edge.ports import ActiveBundle, PlanningService, PlanRequest, Store
from igrow.edge.sensors.consequences import usable_for_planning
from igrow.edge.sources.recipe import Recipe, recipe_course

log = logging.getLogger("igrow.edge")

ESSENTIAL = ("air_temperature", "air_humidity", "air_co2")
"""Where a plan starts from. While one that the plant measures cannot be believed, no new plan is made."""
LEAST_HISTORY = 24 * 3600.0
"""Seconds of log that a plan needs: its weather is that of the last days."""
RETRY = 900.0
"""Seconds after a failed plan until the next is tried."""
LEAD = 2 * RETRY
"""Seconds before its beginning that a plan is asked for, so that one may fail; at most half of the pace."""


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
        self._due = float("-inf")
        self._asked: float | None = None
        """Seconds since 1970 UTC at which the plan that was last asked for begins."""
        self._next: float | None = None
        """Seconds since 1970 UTC at which the next plan is to begin."""
        self._began: float | None = None
        self._requests = 0
        self.problem = ""

    async def tick(self, image: Image, bundle: ActiveBundle | None) -> bool:
        """Ask for a plan when one is due; tell whether one was asked for."""
        if image.true_time is None:
            self.problem = "no plans while the clock is wrong"
            return False
        if self._began is None:
            self._began = await self._beginning(image)
        if image.monotonic < self._due or self._service.busy:
            return False
        self.problem = self._obstacle(image, bundle)
        if self.problem or bundle is None:
            return False
        try:
            request = await asyncio.to_thread(self._request, image.true_time, bundle)
        except (IgrowError, OSError) as error:
            self.problem = f"no plan: {error}"
            self._due = image.monotonic + RETRY
            return False
        self._service.request(request)
        self._requests += 1
        self._asked, self._next = request.time, request.time + self._rules.every
        self._due = image.monotonic + (self._next - self._lead - image.true_time)
        return True

    def retry_soon(self, monotonic: float) -> None:
        """Ask again before the next K1, since the last plan failed."""
        self._due = min(self._due, monotonic + RETRY)

    @property
    def _lead(self) -> float:
        return min(LEAD, 0.5 * self._rules.every)

    def _obstacle(self, image: Image, bundle: ActiveBundle | None) -> str:
        if bundle is None:
            return "no plans without a bundle"
        for name in ESSENTIAL:
            if name in image.values and usable_for_planning(image.values[name]) is None:
                return f"no new plan while {name} is {image.values[name].quality.value}"
        assert self._began is not None
        history = image.monotonic - self._began
        if history < LEAST_HISTORY:
            return f"the first plan needs a day of log: {(LEAST_HISTORY - history) / 3600:.0f} h more"
        return ""

    async def _beginning(self, image: Image) -> float:
        """Return the monotonic time at which the log of the last days begins."""
        assert image.true_time is not None
        log_so_far = await asyncio.to_thread(
            self._store.telemetry, image.true_time - self._rules.history, image.true_time
        )
        if not len(log_so_far):
            return image.monotonic
        first = float(log_so_far.time[0].astype("datetime64[s]").astype(float))
        return image.monotonic - (image.true_time - first)

    def _request(self, now: float, bundle: ActiveBundle) -> PlanRequest:
        rules = self._rules
        start = now - now % rules.step
        for begins in (self._asked, self._next):
            if begins is not None and now <= begins <= now + self._lead:
                start = begins
                break
        steps = max(1, round(rules.horizon / rules.step))
        forecast: tuple[Telemetry, ...] = ()
        if rules.forecast is not None and rules.forecast.exists():
            forecast = read_forecast(rules.forecast)
        return PlanRequest(
            time=start,
            step_seconds=rules.step,
            telemetry=self._store.telemetry(now - rules.history, now + 1.0),
            recipe=recipe_course(self._recipe, self._zone, start, rules.step, steps),
            bundle=bundle.folder,
            forecast=forecast,
            seed=rules.seed + self._requests,
        )
