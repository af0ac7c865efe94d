"""When plans are asked for, and when not."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.telemetry import Telemetry, write_csv
from igrow.edge.image import Image, Quality, Value
from igrow.edge.planning_schedule import ESSENTIAL, PlanningRules, PlanningSchedule
from igrow.edge.ports import ActiveBundle, Plan, PlanRequest
from igrow.edge.sources import FreshPlan, PlanKeeper, Recipe

T0 = 1_772_323_200.0
HOUR = 3600.0
BUNDLE = ActiveBundle("b1", Path("/bundle"))


@dataclass
class FakePlanning:
    busy: bool = False
    health: str = ""
    requests: list[PlanRequest] = field(default_factory=list)

    def request(self, request: PlanRequest) -> None:
        self.requests.append(request)

    def latest(self) -> Plan | None:
        return None


@dataclass
class LogStore:
    """A store whose log began some hours before T0."""

    hours: float

    def telemetry(self, start: float, end: float) -> Telemetry:
        first = T0 - self.hours * HOUR
        seconds = np.arange(max(start, first), min(end, T0 + 1), 300.0).astype(np.int64)
        return Telemetry(seconds.astype("datetime64[s]"), {"air_temperature": np.full(len(seconds), 20.0)})


def make(hours=48.0, forecast=None):
    planning = FakePlanning()
    rules = PlanningRules(every=6 * HOUR, horizon=48 * HOUR, step=HOUR, history=96 * HOUR, seed=5, forecast=forecast)
    schedule = PlanningSchedule(rules, planning, LogStore(hours), Recipe(), ZoneInfo("UTC"))
    return schedule, planning


def image(hours=0.0, *, dated=True, **quality):
    values = {name: Value(20.0, quality.get(name, Quality.GOOD), 0.0) for name in ESSENTIAL}
    return Image(hours * HOUR, T0 + hours * HOUR if dated else None, values)


async def test_a_plan_is_asked_for_at_once_and_then_at_the_sites_pace_before_it_begins():
    schedule, planning = make()
    asked = [await schedule.tick(image(0.5 * step), BUNDLE) for step in range(25)]
    assert [0.5 * step for step, was in enumerate(asked) if was] == [0.0, 5.5, 11.5]
    assert [(request.time - T0) / HOUR for request in planning.requests] == [0.0, 6.0, 12.0]


async def test_a_plan_that_fails_is_asked_for_again_before_it_should_have_begun():
    schedule, planning = make()
    await schedule.tick(image(), BUNDLE)
    await schedule.tick(image(5.5), BUNDLE)
    schedule.retry_soon(5.5 * HOUR)
    assert await schedule.tick(image(5.75), BUNDLE)
    assert [(request.time - T0) / HOUR for request in planning.requests] == [0.0, 6.0, 6.0]


@pytest.mark.parametrize("every", [1.0, 6.0, 24.0])
@pytest.mark.parametrize("takes", [0.0, 0.2])
async def test_nobody_else_leads_between_two_plans(every, takes):
    """Three days of five-minute cycles: from the first plan on, each is there when the one before it ends."""
    planning = FakePlanning()
    rules = PlanningRules(every=every * HOUR, horizon=24 * HOUR, step=HOUR, history=96 * HOUR, seed=5)
    schedule = PlanningSchedule(rules, planning, LogStore(48.0), Recipe(), ZoneInfo("UTC"))
    made = None

    def plan_of(request):
        end = request.time + every * HOUR
        return Plan(request.time, request.time, HOUR, {"heating_setpoint": (18.0,) * 24}, end, "b1")

    keeper = PlanKeeper(lambda: made)
    leader = FreshPlan(keeper, fresh_for=1.5 * every * HOUR)
    silent, asked_at = [], []
    for step in range(3 * 288):
        now = image(step / 12)
        if await schedule.tick(now, BUNDLE):
            asked_at.append(step / 12)
        if planning.requests and step / 12 >= asked_at[-1] + takes:
            request = planning.requests[-1]
            made = made if made is not None and made.start == request.time else plan_of(request)
        if not leader.offer(now).setpoints:
            silent.append(step / 12)
    assert all(hour < takes + 0.1 for hour in silent)
    assert len(planning.requests) >= 72 / every


async def test_a_request_holds_what_a_plan_is_made_from():
    schedule, planning = make()
    await schedule.tick(image(0.5), BUNDLE)
    (request,) = planning.requests
    assert (request.time, request.step_seconds, request.seed, request.bundle) == (T0, HOUR, 5, Path("/bundle"))
    assert {len(course) for course in request.recipe.values()} == {48}
    assert len(request.telemetry) > 12 * 47


async def test_nothing_is_asked_for_while_a_plan_is_being_made():
    schedule, planning = make()
    planning.busy = True
    assert not await schedule.tick(image(), BUNDLE)


@pytest.mark.parametrize("quality", [quality for quality in Quality if quality is not Quality.GOOD])
@pytest.mark.parametrize("name", ESSENTIAL)
async def test_no_plan_starts_from_a_sensor_that_is_not_good(quality, name):
    schedule, planning = make()
    assert not await schedule.tick(image(**{name: quality}), BUNDLE)
    assert schedule.problem == f"no new plan while {name} is {quality.value}"
    assert await schedule.tick(image(1.0), BUNDLE)
    assert schedule.problem == ""
    assert len(planning.requests) == 1


async def test_without_a_bundle_a_clock_or_a_day_of_log_there_is_no_plan():
    schedule, _ = make()
    assert not await schedule.tick(image(), None)
    assert schedule.problem == "no plans without a bundle"
    assert not await schedule.tick(image(dated=False), BUNDLE)
    assert schedule.problem == "no plans while the clock is wrong"
    young, planning = make(hours=20.0)
    assert not await young.tick(image(), BUNDLE)
    assert young.problem == "the first plan needs a day of log: 4 h more"
    assert await young.tick(image(4.1), BUNDLE)
    assert len(planning.requests) == 1


async def test_a_failed_plan_is_tried_again_soon_but_not_at_once():
    schedule, planning = make()
    await schedule.tick(image(), BUNDLE)
    schedule.retry_soon(0.0)
    assert not await schedule.tick(image(0.2), BUNDLE)
    assert await schedule.tick(image(0.25), BUNDLE)
    assert len(planning.requests) == 2
    assert planning.requests[0].seed != planning.requests[1].seed


async def test_a_forecast_is_read_when_it_is_there_and_a_broken_one_is_reported(tmp_path):
    path = tmp_path / "forecast.csv"
    schedule, planning = make(forecast=path)
    await schedule.tick(image(), BUNDLE)
    assert planning.requests[0].forecast == ()
    seconds = (T0 + np.arange(48) * HOUR).astype(np.int64).astype("datetime64[s]")
    write_csv(path, Telemetry(seconds, {"wind_speed": np.full(48, 3.0)}))
    await schedule.tick(image(6.0), BUNDLE)
    assert len(planning.requests[1].forecast) == 1
    path.write_text("nonsense\n")
    assert not await schedule.tick(image(12.0), BUNDLE)
    assert "forecast.csv" in schedule.problem
