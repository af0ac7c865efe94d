"""When plans are asked for, and when not."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.co2_count import CO2Count
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.image import Image, Quality, Value
from igrow.edge.planning_schedule import ESSENTIAL, PlanningRules, PlanningSchedule
from igrow.edge.ports import ActiveBundle, Plan, PlanRequest
from igrow.edge.sources import FreshPlan, PlanKeeper, Recipe
from igrow.edge.store import StoreError
from tests.control.control_fakes import MemoryStore

T0 = 1_772_323_200.0
HOUR = 3600.0
BUNDLE = ActiveBundle("b1", Path("/bundle"))


@dataclass
class FakePlanning:
    site: Site = field(default_factory=lambda: Site(name="greenhouse", latitude=52.0, longitude=4.5))
    busy: bool = False
    health: str = ""
    requests: list[PlanRequest] = field(default_factory=list)

    def request(self, prepare: Callable[[], PlanRequest | None]) -> None:
        request = prepare()
        if request is not None:
            self.requests.append(request)

    def latest(self) -> Plan | None:
        return None

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109 - as the service has it
        return

    def close(self) -> None:
        return


@dataclass
class LogStore(MemoryStore):
    """A store whose log began some hours before T0."""

    hours: float = 48.0

    def telemetry(self, start: float, end: float) -> Telemetry:
        first = T0 - self.hours * HOUR
        seconds = np.arange(max(start, first), min(end, T0 + 1), 300.0).astype(np.int64)
        return Telemetry(seconds.astype("datetime64[s]"), {"air_temperature": np.full(len(seconds), 20.0)})


def make(hours=48.0, forecast=None):
    planning = FakePlanning()
    rules = PlanningRules(every=6 * HOUR, horizon=48 * HOUR, step=HOUR, history=96 * HOUR, seed=5, forecast=forecast)
    schedule = PlanningSchedule(rules, planning, LogStore(hours=hours), Recipe(), ZoneInfo("UTC"))
    return schedule, planning


def image(hours=0.0, *, dated=True, **quality):
    values = {name: Value(20.0, quality.get(name, Quality.GOOD), 0.0) for name in ESSENTIAL}
    return Image(hours * HOUR, T0 + hours * HOUR if dated else None, values)


def test_a_plan_is_asked_for_at_once_and_then_at_the_sites_pace_before_it_begins():
    schedule, planning = make()
    asked = [schedule.tick(image(0.5 * step), BUNDLE) for step in range(25)]
    assert [0.5 * step for step, was in enumerate(asked) if was] == [0.0, 5.5, 11.5]
    assert [(request.time - T0) / HOUR for request in planning.requests] == [0.0, 6.0, 12.0]


def test_a_plan_that_fails_is_asked_for_again_before_it_should_have_begun():
    schedule, planning = make()
    schedule.tick(image(), BUNDLE)
    schedule.tick(image(5.5), BUNDLE)
    schedule.retry_soon(5.5 * HOUR)
    assert schedule.tick(image(5.75), BUNDLE)
    assert [(request.time - T0) / HOUR for request in planning.requests] == [0.0, 6.0, 6.0]


@pytest.mark.parametrize("every", [1.0, 6.0, 24.0])
@pytest.mark.parametrize("takes", [0.0, 0.2])
def test_nobody_else_leads_between_two_plans(every, takes):
    """Three days of five-minute cycles: from the first plan on, each is there when the one before it ends."""
    planning = FakePlanning()
    rules = PlanningRules(every=every * HOUR, horizon=24 * HOUR, step=HOUR, history=96 * HOUR, seed=5)
    schedule = PlanningSchedule(rules, planning, LogStore(), Recipe(), ZoneInfo("UTC"))
    made = None

    def plan_of(request):
        end = request.time + every * HOUR
        return Plan(request.time, request.time, HOUR, {"heating_setpoint": (18.0,) * 24}, end, "b1")

    keeper = PlanKeeper(lambda: made)
    leader = FreshPlan(keeper, fresh_for=1.5 * every * HOUR)
    silent, asked_at = [], []
    for step in range(3 * 288):
        now = image(step / 12)
        if schedule.tick(now, BUNDLE):
            asked_at.append(step / 12)
        if planning.requests and step / 12 >= asked_at[-1] + takes:
            request = planning.requests[-1]
            made = made if made is not None and made.start == request.time else plan_of(request)
        if not leader.offer(now).setpoints:
            silent.append(step / 12)
    assert all(hour < takes + 0.1 for hour in silent)
    assert len(planning.requests) >= 72 / every


def test_a_request_holds_what_a_plan_is_made_from():
    schedule, planning = make()
    schedule.tick(image(0.5), BUNDLE)
    (request,) = planning.requests
    assert (request.time, request.step_seconds, request.seed, request.bundle) == (T0, HOUR, 5, Path("/bundle"))
    assert {len(course) for course in request.recipe.values()} == {48}
    assert len(request.telemetry) > 12 * 47


def test_nothing_is_asked_for_while_a_plan_is_being_made():
    schedule, planning = make()
    planning.busy = True
    assert not schedule.tick(image(), BUNDLE)


@pytest.mark.parametrize("quality", [quality for quality in Quality if quality is not Quality.GOOD])
@pytest.mark.parametrize("name", ESSENTIAL)
def test_no_plan_starts_from_a_sensor_that_is_not_good(quality, name):
    schedule, planning = make()
    assert not schedule.tick(image(**{name: quality}), BUNDLE)
    assert schedule.problem == f"no new plan while {name} is {quality.value}"
    assert schedule.tick(image(1.0), BUNDLE)
    assert schedule.problem == ""
    assert len(planning.requests) == 1


def test_without_a_bundle_a_clock_or_a_day_of_log_there_is_no_plan():
    schedule, _ = make()
    assert not schedule.tick(image(), None)
    assert schedule.problem == "no plans without a bundle"
    assert not schedule.tick(image(dated=False), BUNDLE)
    assert schedule.problem == "no plans while the clock is wrong"
    young, planning = make(hours=20.0)
    young.tick(image(), BUNDLE)
    assert not young.tick(image(0.1), BUNDLE)
    assert young.problem == "the first plan needs a day of log: 4 h more"
    assert planning.requests == []
    assert young.tick(image(4.1), BUNDLE)
    assert len(planning.requests) == 1


@pytest.mark.parametrize("years", [10, -10])
def test_a_plan_and_a_young_log_that_a_wrong_clock_has_dated_are_forgotten_when_it_is_right(years):
    schedule, planning = make(hours=30.0)
    wrong = replace(image(), true_time=T0 + years * 365 * 86_400.0)
    schedule.tick(wrong, BUNDLE)
    assert schedule.tick(image(0.1), BUNDLE)
    assert [request.time for request in planning.requests] == [T0]


def test_a_clock_that_is_corrected_a_little_costs_no_plan():
    schedule, planning = make()
    schedule.tick(image(), BUNDLE)
    assert not schedule.tick(replace(image(0.1), true_time=T0 + 0.1 * HOUR + 300.0), BUNDLE)
    assert len(planning.requests) == 1


def test_a_failed_plan_is_tried_again_soon_but_not_at_once():
    schedule, planning = make()
    schedule.tick(image(), BUNDLE)
    schedule.retry_soon(0.0)
    assert not schedule.tick(image(0.2), BUNDLE)
    assert schedule.tick(image(0.25), BUNDLE)
    assert len(planning.requests) == 2
    assert planning.requests[0].seed != planning.requests[1].seed


def test_the_forecast_is_left_to_the_process_to_read(tmp_path):
    path = tmp_path / "forecast.csv"
    os.mkfifo(path)
    schedule, planning = make(forecast=path)
    assert schedule.tick(image(), BUNDLE)
    assert planning.requests[0].forecast == path


@pytest.mark.parametrize("started_anew", [False, True])
def test_a_plan_goes_on_from_what_the_one_before_it_counted_of_co2(started_anew):
    """Also after a restart or a reload: what was counted stands in the ledger, and not in a schedule."""
    schedule, planning = make()
    schedule.tick(image(), BUNDLE)
    assert planning.requests[0].co2_counted is None
    if started_anew:
        before = schedule
        schedule, planning = make()
        schedule._store = before._store
    begun = datetime.fromtimestamp(T0, UTC).isoformat()
    schedule._store.record_event(T0, "plan", {"start": begun, "co2_before": 4.2})
    schedule.tick(image(5.5), BUNDLE)
    assert planning.requests[-1].co2_counted == CO2Count(T0, 4.2)


def test_a_ledger_that_cannot_be_read_costs_no_plan():
    class Unreadable(LogStore):
        def newest_event(self, kind):
            raise StoreError("the ledger cannot be read")

    schedule, planning = make()
    schedule._store = Unreadable()
    assert schedule.tick(image(), BUNDLE)
    assert planning.requests[0].co2_counted is None
