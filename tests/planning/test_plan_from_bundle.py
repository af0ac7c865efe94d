"""A plan from the default bundle: what the planning process runs, without the process."""

from __future__ import annotations

import datetime
import os
import pickle
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.co2_count import CO2Count, co2_since_planting
from igrow.core.planner import Budget, PlanResult, optimise
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator.outcome import Initial, Outcome
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.cli.plan import reasons
from igrow.edge.planning.make_plan import hourly_recipe, make_plan, present, recently
from igrow.edge.ports import PlanRequest
from igrow.trainer.exporting import export, read_model

START = 1_780_012_800
RECIPE = {"heating_setpoint": 18.0, "co2_setpoint": 600.0, "lamp_on": 0.0, "irrigation_on": 0.2}
SITE = Site(name="demo", latitude=52.0, longitude=4.3)


def log() -> Telemetry:
    seconds = np.arange(START - 3 * 86400, START + 1, 300)
    day = 2 * np.pi * (seconds % 86400) / 86400
    columns = {
        "outdoor_temperature": 12.0 - 5.0 * np.cos(day),
        "outdoor_humidity": 80.0 + 10.0 * np.cos(day),
        "global_radiation": np.maximum(0.0, -600.0 * np.cos(day)),
        "wind_speed": np.full(len(seconds), 4.0),
        "air_temperature": 20.0 - 2.0 * np.cos(day),
        "air_humidity": np.full(len(seconds), 78.0),
        "air_co2": np.full(len(seconds), 550.0),
        "leaf_area_index": np.where(seconds == START - 2 * 86400, 3.0, np.nan),
        **{name: np.full(len(seconds), value) for name, value in RECIPE.items()},
    }
    return Telemetry(seconds.astype("datetime64[s]"), columns)


def request(step: float = 3600.0, steps: int = 24, names: tuple[str, ...] = USUAL_SETPOINTS) -> PlanRequest:
    recipe = {name: (RECIPE[name],) * steps for name in names}
    return PlanRequest(float(START), step, log(), recipe, default_bundle_folder())


def test_a_plan_without_its_forecast_stays_within_the_limits_and_is_worth_no_less_than_the_recipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The forecast lies on a share that hangs: the plan is made all the same, and says so."""
    monkeypatch.setattr("igrow.edge.planning.forecast.READ_SECONDS", 0.2)
    os.mkfifo(tmp_path / "forecast.csv")
    plan = make_plan(SITE, replace(request(), forecast=tmp_path / "forecast.csv"))
    assert "not read within 0.2 s" in plan.problem
    assert set(plan.setpoints) == set(USUAL_SETPOINTS)
    for name, course in plan.setpoints.items():
        limits = SITE.limits[name]
        assert len(course) == 24
        assert limits.low - 1e-6 <= min(course) <= max(course) <= limits.high + 1e-6
    assert np.isfinite([plan.expected_profit, plan.recipe_profit]).all()
    assert plan.valid_until == START + 86400
    assert len(plan.predicted["air_temperature"]) == 24
    assert all(5.0 < value < 45.0 for value in plan.predicted["air_temperature"])


def test_a_plan_of_one_day_is_searched_with_the_day_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Dark hours count over midnight: lamps that burn until then take the next morning's cheap light, unseen."""
    results: list[PlanResult] = []

    def search(*arguments: Any, **options: Any) -> PlanResult:
        results.append(optimise(*arguments, **options))
        return results[-1]

    monkeypatch.setattr("igrow.edge.planning.make_plan.optimise", search)
    monkeypatch.setattr("igrow.edge.planning.make_plan.Budget", lambda: Budget(candidates=400))
    plan = make_plan(SITE, request())
    (found,) = results
    assert len(found.setpoints) == 48
    assert len(plan.setpoints["lamp_on"]) == 24
    assert (plan.expected_profit, plan.recipe_profit) == found.profits(24)
    assert found.profits(48) == pytest.approx((found.expected_profit, found.recipe_profit))


def test_slow_quantities_count_however_old_and_fast_ones_do_not() -> None:
    table = log()
    stale = table.with_columns(
        {"air_co2": np.where(table.time.astype(np.int64) > START - 4 * 3600, np.nan, table["air_co2"])}
    )
    values = present(stale, START)
    assert values["leaf_area_index"] == 3.0
    assert values["air_temperature"] == pytest.approx(20.0 - 2.0 * np.cos(2 * np.pi * (START % 86400) / 86400))
    assert "air_co2" not in values


@pytest.mark.parametrize(("step", "steps"), [(600.0, 144), (3600.0, 24), (7200.0, 12), (3600.0, 30)])
def test_a_recipe_of_any_step_becomes_hours(step: float, steps: int) -> None:
    hours = 48
    table = hourly_recipe(SITE, request(step, steps), hours)
    assert table.shape == (hours, len(SETPOINTS))
    assert (table == [RECIPE.get(name, SITE.limits[name].safe) for name in SETPOINTS]).all()


def test_a_setpoint_that_the_site_lacks_stands_at_its_safe_value() -> None:
    table = hourly_recipe(SITE, request(names=("heating_setpoint", "co2_setpoint")), 24)
    assert (table[:, SETPOINTS.index("lamp_on")] == SITE.limits["lamp_on"].safe).all()


class OneUnitAnHour:
    """A simulator by which every hour uses and grows one unit."""

    setpoints = USUAL_SETPOINTS

    def simulate(
        self, initial: Initial, weather: np.ndarray, setpoints: np.ndarray, start: np.datetime64 | np.ndarray
    ) -> Outcome:
        ones = np.ones((1, *setpoints.shape[:2]))
        return Outcome(**{one.name: ones for one in fields(Outcome)})


def test_plans_are_corrected_by_what_the_log_s_last_days_used() -> None:
    dosed = log().with_columns({"co2_dosing": np.full(len(log()), 1.4)})
    found = recently(OneUnitAnHour(), None, SITE, dosed, START).factor
    assert 1.2 < found["co2"] < 1.4
    assert [found[name] for name in ("heat", "electricity")] == [1.0, 1.0]
    short = dosed.select(np.datetime64(START - 20 * 3600, "s"), np.datetime64(START + 1, "s"))
    assert recently(OneUnitAnHour(), None, SITE, short, START).factor["co2"] == 1.0


def test_the_co2_that_the_crop_has_had_follows_from_the_log_s_days_and_those_since_planting() -> None:
    planted = datetime.date(2026, 4, 29)
    days = START / 86400 - (planted - datetime.date(1970, 1, 1)).days
    site = replace(SITE, crop=replace(SITE.crop, planting_date=planted))
    dosing = np.where(np.arange(len(log())) % 2 == 0, 0.004, 0.0)
    dosing[:100] = np.nan
    dosed = log().with_columns({"co2_dosing": dosing})
    assert co2_since_planting(site, dosed, START) == pytest.approx(0.002 * 24 * days, rel=0.01)
    assert co2_since_planting(site, log(), START) == 0.0
    later = replace(site, crop=replace(site.crop, planting_date=datetime.date(2027, 1, 1)))
    assert co2_since_planting(later, dosed, START) == 0.0


def test_what_doses_more_since_last_week_has_not_done_so_since_planting(monkeypatch: pytest.MonkeyPatch) -> None:
    """A count goes on from plan to plan: a leak of today makes neither the CO2 of the past nor its price dearer."""
    planted = np.datetime64(START, "s") - np.timedelta64(60, "D")
    site = replace(SITE, crop=replace(SITE.crop, planting_date=planted.astype("datetime64[D]").astype(object)))
    leaking = log().with_columns({"co2_dosing": np.full(len(log()), 0.015)})
    assert co2_since_planting(site, leaking, START) > 20.0
    counted = CO2Count(START - 86_400.0, 5.0)
    assert co2_since_planting(site, leaking, START, counted) == pytest.approx(5.0 + 0.015 * 24)
    # A daemon that stood still for a while counts on by what it has seen since.
    assert co2_since_planting(site, leaking, START, CO2Count(START - 10 * 86_400.0, 5.0)) == pytest.approx(8.6)
    # The count of the crop before is none of this one's.
    another = CO2Count(START - 80 * 86_400.0, 30.0)
    assert co2_since_planting(site, leaking, START, another) == co2_since_planting(site, leaking, START)
    assert co2_since_planting(site, log(), START, counted) == 5.0

    # What the recipe is worth is no affair of the search.
    monkeypatch.setattr("igrow.edge.planning.make_plan.Budget", lambda: Budget(candidates=400))
    known = make_plan(site, replace(request(), telemetry=leaking, co2_counted=counted))
    assert known.co2_before == pytest.approx(5.36)
    assert make_plan(site, replace(request(), telemetry=leaking)).recipe_profit < known.recipe_profit


def test_a_plan_is_explained_and_names_the_limits_that_bind() -> None:
    """A grower who never lets lamps rest is told what kept the plan from it, and that nobody counted growth."""
    lit = replace(request(), recipe={**request().recipe, "lamp_on": (1.0,) * 24})
    plan = make_plan(replace(SITE, planning=replace(SITE.planning, optimise=("heating_setpoint",))), lit)
    assert any("dark_hours" in step for step in plan.binding["lamp_on"])
    assert "dark hours (lamp on)" in plan.note
    assert "the log counts no growth" in plan.note
    told = "\n".join(reasons(plan, ZoneInfo("UTC")))
    assert "lamp_on by dark_hours" in told
    assert "95 % between" in told
    assert pickle.loads(pickle.dumps(plan)) == plan


@pytest.mark.slow
@pytest.mark.parametrize("taken", [False, True])
def test_a_plan_holds_a_humidity_setpoint_only_where_the_site_takes_one(tmp_path: Path, taken: bool) -> None:
    """The bundle knows it in both cases."""
    damp = replace(
        SITE,
        setpoints=(*USUAL_SETPOINTS, "humidity_setpoint"),
        planning=replace(SITE.planning, optimise=("heating_setpoint", "humidity_setpoint")),
    )
    model = read_model(read_bundle(default_bundle_folder()), damp)
    rules = {"lee_humidity": 0.0, "windward_humidity": 0.0, "lee_humidity_opening": 0.4}
    bundle = export(replace(model, actuation={**model.actuation, **rules}), tmp_path / "bundle")
    asked = replace(request(), bundle=bundle.folder)
    if taken:
        asked = replace(asked, recipe={**asked.recipe, "humidity_setpoint": (85.0,) * 24})
    plan = make_plan(damp if taken else SITE, asked)
    assert set(plan.setpoints) == set(damp.setpoints if taken else USUAL_SETPOINTS)
    if taken:
        course, limits = np.array(plan.setpoints["humidity_setpoint"]), damp.limits.humidity_setpoint
        assert (course >= limits.low).all() and (course <= limits.high).all()
        assert (course != 85.0).any(), "nothing else has a say in the heat that damp air saves"
