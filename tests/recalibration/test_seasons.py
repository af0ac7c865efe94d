"""The loop's bundles carry their season: planned with what is published, and once where nothing else is better."""

from __future__ import annotations

import datetime
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.planner.season import SeasonPlan
from igrow.core.site import Crop, Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.exporting import read_model
from igrow.trainer.fit import FittedModel
from igrow.trainer.season import plan_season
from igrow.trainer.service import recalibration, seasons
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.recalibration import recalibrate
from tests.made_once import made_once

CROP = Crop(planting_date=datetime.date(2020, 2, 21), end_date=datetime.date(2020, 3, 31))
SITE = Site(name="greenhouse", latitude=52.0, longitude=4.5, crop=CROP)
NOON = datetime.datetime(2020, 3, 1, 12, tzinfo=datetime.UTC)


@pytest.fixture(autouse=True)
def _a_short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seasons, "plan_season", partial(plan_season, generations=3))


@pytest.fixture(scope="module")
@made_once
def planned() -> FittedModel:
    """The built-in simulator with the season of a young crop."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(seasons, "plan_season", partial(plan_season, generations=3))
        model, notes = seasons.with_season(read_model(read_bundle(default_bundle_folder()), SITE), NOON)
    assert notes == ()
    return model


def with_crop(**changed: Any) -> Site:
    return replace(SITE, crop=replace(CROP, **changed))


@pytest.mark.parametrize(
    "changed",
    [
        {"end_date": None},
        {"planting_date": datetime.date(2020, 3, 2)},
        {"end_date": datetime.date(2020, 3, 20)},
        {"end_date": datetime.date(2020, 2, 25)},
    ],
    ids=["no end", "not planted yet", "nearly over", "over"],
)
def test_no_season_is_lacking_where_none_can_be_planned(changed: dict[str, datetime.date | None]) -> None:
    built_in = read_bundle(default_bundle_folder())
    assert seasons.lacking(built_in, SITE, NOON)
    assert not seasons.lacking(built_in, with_crop(**changed), NOON)


@pytest.mark.slow
def test_a_season_that_cannot_be_planned_is_said_and_the_one_before_stays(planned: FittedModel) -> None:
    assert planned.season is not None
    endless = replace(planned, site=with_crop(end_date=None))
    same, notes = seasons.with_season(endless, NOON)
    assert same.season is planned.season
    assert notes == (
        "no season is planned: greenhouse: crop.end_date is not set: a season that has no end cannot be planned",
    )


@pytest.mark.slow
def test_the_season_of_a_crop_that_bears_begins_today_and_that_of_a_young_one_with_its_planting(
    planned: FittedModel,
) -> None:
    assert planned.season is not None and planned.season.start == np.datetime64("2020-02-21T00:00:00")
    old = replace(planned, season=None, site=with_crop(planting_date=datetime.date(2019, 12, 1)))
    bearing, _ = seasons.with_season(old, NOON)
    assert bearing.season is not None and bearing.season.start == np.datetime64("2020-03-01T00:00:00")
    assert bearing.season.covers(np.datetime64("2020-03-01T12:00:00"))


@pytest.mark.slow
def test_of_a_crop_that_stands_for_years_a_year_is_planned(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Any, Any]] = []

    def noted(site: Site, _: object, *, begins: datetime.date) -> None:
        asked.append((begins, site.crop.end_date))

    monkeypatch.setattr(seasons, "plan_season", noted)
    roses = with_crop(planting_date=datetime.date(2018, 1, 1), end_date=datetime.date(2024, 1, 1))
    seasons.with_season(read_model(read_bundle(default_bundle_folder()), roses), NOON)
    assert asked == [(datetime.date(2020, 3, 1), datetime.date(2021, 2, 28))]


@pytest.mark.slow
def test_a_model_in_force_that_has_no_season_is_published_once_with_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, planned: FittedModel
) -> None:
    monkeypatch.setattr(seasons, "plan_season", lambda *_, **__: planned.season)
    archive = Archive(tmp_path / "archive")
    time = np.datetime64("2020-02-20T00:00:00") + np.arange(0, 9 * 86_400, 600).astype("timedelta64[s]")
    archive.add_telemetry("greenhouse", Telemetry(time, {"air_temperature": np.full(len(time), 20.0)}))

    nothing_better = SimpleNamespace(verdict="nothing", findings=(), errors={}, notes=(), corrected=None)
    monkeypatch.setattr(recalibration, "_diagnose", lambda *_: nothing_better)
    monkeypatch.setattr(seasons, "export_planned", lambda *_: pytest.fail("a worse model was written"))
    published: list[Path] = []
    turn = recalibrate(SITE, archive, tmp_path / "state", published.append, now=NOON)
    assert turn.published and turn.note.endswith("the model in force, with the season planned")
    (folder,) = published
    season = SeasonPlan.of(read_bundle(folder))
    assert season is not None and season.covers(np.datetime64("2020-03-01T12:00:00"))

    def fails(*_: object, **__: object) -> None:
        raise IgrowError("no such weather")

    with monkeypatch.context() as patched:
        patched.setattr(seasons, "plan_season", fails)
        unplanned = recalibrate(SITE, archive, tmp_path / "other", published.append, now=NOON)
    assert (unplanned.verdict, unplanned.published) == ("nothing", False)
    assert "no season is planned: no such weather" in unplanned.notes
    again = recalibrate(SITE, archive, tmp_path / "state", published.append, now=NOON, force=True)
    assert not again.published and again.note.startswith("the bundle in force stays")
