"""A calibration learns how fast the crop grows from what the log counts, and says so where it counts nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.local_time import to_local
from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.growth import GrowthFit, prior_of
from igrow.core.site import Agronomy, Crop
from igrow.core.telemetry import Telemetry
from igrow.trainer import prepare_log
from igrow.trainer.data import Log
from igrow.trainer.data.source import DailyTable
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.growth import (
    Canopy,
    built_in_crop,
    counts_of,
    growth_days,
    growth_notes,
    growth_of_log,
    growth_since,
)
from tests.virtual_log import SITE, virtual_log

DAYS, STEP = 84, 3600.0
PARAMETERS = FittedModel.described(SITE).posterior.values
CANOPY = Canopy(PARAMETERS)
SLOW, HUNGRY = 0.8, 2.0
"""Conversion and maintenance of the crop that grew, over those of the built-in one."""


@pytest.fixture(scope="module")
def telemetry() -> Telemetry:
    return virtual_log(DAYS, seed=11, step=STEP)


@pytest.fixture(scope="module")
def before() -> CropStages:
    return built_in_crop()


def grown(telemetry: Telemetry, before: CropStages) -> np.ndarray:
    """Return what a crop of `SLOW` and `HUNGRY` had grown by the end of each local day, kg m-2."""
    log = prepare_log(telemetry, SITE)
    _, days = growth_days(log.record(), CANOPY, SITE.time_zone)
    growth = SLOW * before.conversion * days.assimilated - HUNGRY * before.maintenance * days.warmth
    return np.cumsum(np.nan_to_num(growth))


def with_counts(telemetry: Telemetry, running: np.ndarray, name: str, every: int) -> Log:
    """Return the log with a running total that was counted at midnight of each `every`th day."""
    values = np.full(len(telemetry), np.nan)
    day = (telemetry.time - telemetry.time[0]) / np.timedelta64(1, "D")
    for number in range(every, len(running), every):
        values[np.argmin(np.abs(day - number))] = running[number - 1]
    return prepare_log(telemetry.with_columns({name: values}), SITE)


def test_weekly_counts_of_growth_tell_how_fast_the_crop_grows(telemetry: Telemetry, before: CropStages) -> None:
    log = with_counts(telemetry, grown(telemetry, before), "net_growth", 7)
    stages, fit = growth_of_log(log, log.record(), CANOPY, before)
    assert fit.counts >= 10
    assert "conversion" in fit.told
    _, days = growth_days(log.record(), CANOPY, SITE.time_zone)
    known = np.isfinite(days.assimilated)
    expected = (stages.conversion * days.assimilated - stages.maintenance * days.warmth)[known].sum()
    assert expected == pytest.approx(grown(telemetry, before)[-1], rel=0.05)
    assert stages.covariance is not None
    assert stages.covariance[0, 0] < prior_of(before)[0, 0]


@pytest.mark.slow
def test_a_total_of_every_hour_is_read_from_midnight_to_midnight(telemetry: Telemetry, before: CropStages) -> None:
    """Read at noon, each day's growth stood beside the light of half another day: light seemed to be worth little."""
    running = grown(telemetry, before)
    first, _ = growth_days(prepare_log(telemetry, SITE).record(), CANOPY, SITE.time_zone)
    since = (to_local(telemetry.time, SITE.time_zone) - first) / np.timedelta64(1, "D")
    each_hour = np.interp(since, np.arange(len(running) + 1), np.append(0.0, running))
    counts = counts_of(telemetry.with_columns({"net_growth": each_hour}), None, first, len(running), SITE.time_zone)
    inner = counts[1:-1]
    assert [one.first for one in inner] == list(range(1, len(inner) + 1))
    np.testing.assert_allclose([one.amount for one in inner], np.diff(running)[: len(inner)], rtol=0.02)


def test_what_is_counted_at_noon_is_a_count_for_each_day() -> None:
    time = np.datetime64("2020-02-01T12:00:00") + np.arange(10) * np.timedelta64(1, "D")
    daily = Telemetry(time, {"net_growth": np.arange(10, dtype=np.float64)})
    counts = counts_of(daily, None, np.datetime64("2020-02-01"), 11, "UTC")
    assert [(one.first, one.last) for one in counts] == [(day, day + 1) for day in range(1, 10)]


def test_a_log_that_counts_nothing_leaves_what_is_known_of_other_crops_and_says_so(
    telemetry: Telemetry, before: CropStages
) -> None:
    log = prepare_log(telemetry, SITE)
    stages, fit = growth_of_log(log, log.record(), CANOPY, before)
    assert (stages.conversion, stages.maintenance) == (before.conversion, before.maintenance)
    assert stages.covariance is not None
    np.testing.assert_allclose(stages.covariance, prior_of(before))
    assert "counts no growth" in growth_notes(SITE, before, fit)[0]


def test_harvests_are_counted_by_weeks_and_the_first_is_not(telemetry: Telemetry) -> None:
    """Of fruit that was picked first nobody knows since when it had been ripe."""
    first = np.datetime64("2020-01-01")
    days = first + np.array([50, 52, 54, 57, 60, 64])
    table = DailyTable(days, {"class_a": np.array([9.0, 1.0, 1.0, 2.0, 1.0, 1.0]), "class_b": np.full(6, 0.5)})
    plain = telemetry.only(["air_temperature"])
    counts = counts_of(plain, table, first, 100, "UTC")
    assert [(one.first, one.last, one.kind) for one in counts] == [(51, 58, "picked"), (58, 65, "picked")]
    assert [one.amount for one in counts] == pytest.approx([5.5, 3.0])
    assert counts_of(plain, None, first, 100, "UTC") == []


def test_growth_beyond_what_any_crop_is_known_for_asks_about_the_site_file(
    telemetry: Telemetry, before: CropStages
) -> None:
    """A cucumber that is described as a tomato holds three times the water."""
    log = with_counts(telemetry, 5.0 * grown(telemetry, before), "net_growth", 7)
    _, fit = growth_of_log(log, log.record(), CANOPY, before)
    site = replace(SITE, crop=replace(SITE.crop, dry_matter_fraction=0.09))
    assert "dry_matter_fraction (0.09)" in growth_notes(site, before, fit)[1]


def test_a_crop_that_is_described_as_another_is_told_to_state_its_own(before: CropStages) -> None:
    site = replace(SITE, crop=Crop(species="cucumber", dry_matter_fraction=0.03))
    fit = GrowthFit(before.conversion, before.maintenance, prior_of(before), 0, (), float("nan"))
    told = growth_notes(site, before, fit)[1]
    missing = "fruit_share (0.7), days_to_harvest (47), agronomy"
    assert told == f"crop.species is cucumber, but {missing} are those of a tomato: state this crop's own"
    own = Agronomy(dark_hours=4.0)
    described = Crop(species="cucumber", dry_matter_fraction=0.03, fruit_share=0.6, days_to_harvest=14, agronomy=own)
    for crop in (Crop(), described):
        assert growth_notes(replace(SITE, crop=crop), before, fit) == (fit.sentence,)


def test_growth_that_scatters_from_day_to_day_is_not_underrated(telemetry: Telemetry, before: CropStages) -> None:
    """Assimilates wait in a buffer, and plants that are counted are a sample: what one day lacks the next one has."""
    each = np.diff(grown(telemetry, before), prepend=0.0)
    scattered = np.cumsum(each * (1.0 + 0.6 * (-1.0) ** np.arange(len(each))))
    log = with_counts(telemetry, scattered, "net_growth", 1)
    stages, _ = growth_of_log(log, log.record(), CANOPY, before)
    first, days = growth_days(log.record(), CANOPY, SITE.time_zone)
    counts = counts_of(log.telemetry, None, first, len(days.warmth), SITE.time_zone)
    expected = stages.conversion * days.assimilated - stages.maintenance * days.warmth
    said = sum(expected[one.first : one.last].sum() for one in counts)
    assert said == pytest.approx(sum(one.amount for one in counts), rel=0.02)


def test_growth_stays_where_a_correction_has_moved_the_uptake_of_co2(telemetry: Telemetry, before: CropStages) -> None:
    log = prepare_log(telemetry, SITE)
    record = log.record()
    moved = Canopy({**PARAMETERS, "assimilation_maximum": 0.8 * PARAMETERS["assimilation_maximum"]})
    stages = growth_since(log, record, CANOPY, moved, moved, before)
    _, was = growth_days(record, CANOPY, SITE.time_zone)
    _, now = growth_days(record, moved, SITE.time_zone)
    assert stages.conversion * np.nansum(now.assimilated) == pytest.approx(
        before.conversion * np.nansum(was.assimilated)
    )
    assert stages.maintenance == before.maintenance


def test_counts_of_a_later_log_change_growth(telemetry: Telemetry, before: CropStages) -> None:
    log = with_counts(telemetry, 0.7 * grown(telemetry, before), "net_growth", 7)
    stages = growth_since(log, log.record(), CANOPY, CANOPY, CANOPY, before)
    _, days = growth_days(log.record(), CANOPY, SITE.time_zone)
    expected = np.nansum(stages.conversion * days.assimilated - stages.maintenance * days.warmth)
    assert expected == pytest.approx(0.7 * grown(telemetry, before)[-1], rel=0.06)


def test_growth_falls_by_what_was_found_to_be_missing_and_not_by_what_was_fitted_beside_it(
    telemetry: Telemetry, before: CropStages
) -> None:
    """A crop that assimilates less had grown as before by the bundle that said so: its growth was fitted back to it."""
    log = prepare_log(telemetry, SITE)
    record = log.record()
    moved = Canopy({**PARAMETERS, "assimilation_maximum": 0.8 * PARAMETERS["assimilation_maximum"]})
    missing = moved._replace(effects={"photosynthesis_decline": {"loss": 100.0 / DAYS}})
    stages = growth_since(log, record, CANOPY, missing, moved, before)
    was, now = (np.nansum(growth_days(record, one, SITE.time_zone)[1].assimilated) for one in (CANOPY, missing))
    assert 0.3 < stages.conversion * now / (before.conversion * was) < 0.7
    alone = growth_since(log, record, CANOPY, moved, moved, before)
    assert stages.conversion == pytest.approx(alone.conversion)
