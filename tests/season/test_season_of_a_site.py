"""`igrow-trainer season`: a bundle carries its season, a search that was cut short goes on, and plans speak of it."""

from __future__ import annotations

import datetime
from dataclasses import replace
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.planner import Budget
from igrow.core.planner.season import SeasonPlan, Strategy, course, run_season
from igrow.core.planner.season.course import typical_days
from igrow.core.planner.season.plan import first_crop
from igrow.core.planner.season.search import genetic
from igrow.core.site import Crop, Site
from igrow.edge.cli.plan import reasons
from igrow.edge.planning.make_plan import make_plan
from igrow.trainer import export, read_model, season
from tests.made_once import made_once
from tests.planning.test_plan_from_bundle import START, request

FIRST = datetime.date(2026, 5, 20)
SITE = Site(
    name="demo", latitude=52.0, longitude=4.3, crop=Crop(planting_date=FIRST, end_date=datetime.date(2026, 6, 21))
)


@pytest.fixture(scope="module")
@made_once
def planned() -> SeasonPlan:
    return season.plan_season(SITE, read_bundle(default_bundle_folder()), generations=3)


@pytest.mark.slow
def test_a_bundle_carries_its_season_and_the_day_s_plan_speaks_of_it(
    planned: SeasonPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = replace(read_model(default_bundle_folder(), SITE), season=planned)
    bundle = export(model, tmp_path / "bundle")
    again = read_model(bundle, SITE).season
    assert again is not None
    assert again.to_json() == planned.to_json()
    assert read_model(bundle, replace(SITE, name="another")).season is None, "of another greenhouse it says nothing"
    monkeypatch.setattr("igrow.edge.planning.make_plan.Budget", lambda: Budget(candidates=400))
    plan = make_plan(SITE, replace(request(), bundle=bundle.folder))
    told = "\n".join(reasons(plan, ZoneInfo("UTC")))
    assert "day 9 of 33 of the season" in told
    assert "its strategy for this day: day temperature" in told
    assert "EUR for a kg of fruit that is nearly ripe" in told
    later = datetime.date.fromordinal(datetime.date(1970, 1, 1).toordinal() + START // 86_400 + 400)
    past = replace(planned, start=np.datetime64(later))
    other = export(replace(model, season=past), tmp_path / "past")
    assert make_plan(SITE, replace(request(), bundle=other.folder)).season == ()


@pytest.mark.slow
def test_a_search_that_was_cut_short_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, planned: SeasonPlan
) -> None:
    bundle, partial = read_bundle(default_bundle_folder()), tmp_path / "partial"
    searched = []

    def interrupted(*arguments: Any) -> object:
        searched.append(arguments)
        if len(searched) == 2:
            raise KeyboardInterrupt
        return genetic(*arguments)

    monkeypatch.setattr(season, "genetic", interrupted)
    with pytest.raises(KeyboardInterrupt):
        season.plan_season(SITE, bundle, generations=3, partial=partial)
    assert partial.exists()
    found = season.plan_season(SITE, bundle, generations=3, partial=partial)
    assert len(searched) == 3, "the rule was not searched again"
    assert found.to_json() == planned.to_json()
    assert not partial.exists()


def test_a_season_without_an_end_is_refused() -> None:
    endless = replace(SITE, crop=replace(SITE.crop, end_date=None))
    with pytest.raises(IgrowError, match="end_date is not set"):
        season.plan_season(endless, read_bundle(default_bundle_folder()), generations=3)
    with pytest.raises(IgrowError, match="30 are needed"):
        season.plan_season(SITE, read_bundle(default_bundle_folder()), begins=datetime.date(2026, 7, 1), generations=3)


def test_typical_days_are_a_cold_and_a_mild_one_each_nearest_to_the_mean_of_its_half() -> None:
    days = np.zeros((6, 24, 6))
    days[:, :, 0] = np.array([0.0, 11.0, 1.0, 12.0, 4.0, 9.0])[:, None]
    days[:, :, 3] = np.array([50.0, 90.0, 50.0, 90.0, 50.0, 90.0])[:, None]
    np.testing.assert_array_equal(typical_days(days), days[[2, 1]])
    # A cold day under a bright sky is as mild as a warm one under a dull sky.
    days[:, :, 0], days[:, :, 3] = 5.0, np.array([10.0, 200.0, 20.0, 210.0, 15.0, 205.0])[:, None]
    assert typical_days(days)[:, 0, 3].tolist() == [15.0, 205.0]


def test_days_run_at_once_are_the_days_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """As many passes as there are days are what one after the other would be; two are that to a cent."""
    whole = season.season_of(SITE, read_bundle(default_bundle_folder()), FIRST, None, lambda _line: None)
    strategy = Strategy(whole.days, 2)
    genes = np.random.default_rng(0).random((6, strategy.genes), dtype=np.float32)
    profit = []
    for passes in (1, course.PASSES, len(whole.typical_days)):
        monkeypatch.setattr(course, "PASSES", passes)
        profit.append(run_season(whole, strategy, genes, first_crop(whole.plant, True)).balance.net_profit)
    assert np.abs(profit[1] - profit[2]).max() < 0.01 < np.ptp(profit[2])
    assert np.abs(profit[1] - profit[2]).max() < np.abs(profit[0] - profit[2]).max()


def test_where_a_typical_day_begins_is_the_strategy_s_affair(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cool strategy is not given the warmth of a morning that it never had."""
    whole = season.season_of(SITE, read_bundle(default_bundle_folder()), FIRST, None, lambda _line: None)
    ten = replace(whole, days=10, weather=whole.weather[:2])
    strategy = Strategy(10, 1)
    cool = np.zeros((1, strategy.genes), dtype=np.float32)
    heat = []
    for degrees in (12.0, 24.0):
        monkeypatch.setitem(course.MORNING, "air_temperature", degrees)
        heat.append(float(run_season(ten, strategy, cool, first_crop(ten.plant, True)).used["heat"][0]))
    assert heat[0] == pytest.approx(heat[1], rel=0.1)
