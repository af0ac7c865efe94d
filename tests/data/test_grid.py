"""Any step from a minute to an hour, jittered or not, on one working grid."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import prepare_log
from igrow.trainer.data.grid import interval_means, on_grid, own_step, working_step
from tests.virtual_log import SITE, virtual_log

MINUTE = np.timedelta64(60, "s")
EXPECTED = {
    1: 15,
    2: 12,
    3: 15,
    4: 12,
    5: 15,
    6: 12,
    7: 15,
    10: 10,
    12: 12,
    15: 15,
    20: 20,
    25: 30,
    30: 30,
    45: 60,
    60: 60,
}


@pytest.fixture(scope="module")
def fine() -> Telemetry:
    return virtual_log(9, seed=4, step=60.0)


def every(log: Telemetry, minutes: int) -> Telemetry:
    return Telemetry(log.time[::minutes], {name: values[::minutes] for name, values in log.columns.items()})


@pytest.mark.parametrize(("minutes", "working"), EXPECTED.items())
def test_every_step_has_a_working_step_that_divides_the_hour(fine: Telemetry, minutes: int, working: int) -> None:
    assert working_step(60.0 * minutes) == 60.0 * working
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = prepare_log(every(fine, minutes), SITE)
        record = log.record(0.5)
    assert log.faults == ()
    assert record.step == 60.0 * working
    assert (record.time.astype(np.int64) % record.step == 0).all()
    assert np.isfinite(record.measured["air_temperature"]).mean() > 0.99
    # What was read lies where the finest log has it.
    at = np.searchsorted(fine.time, record.time[1:-1])
    error = record.measured["air_temperature"][1:-1] - fine["air_temperature"][at]
    assert np.nanmean(np.abs(error)) < 0.15
    sunshine = to_grid(fine, 3600)["global_radiation"].mean()
    assert record.inputs["global_radiation"].mean() == pytest.approx(sunshine, rel=0.02)


def test_jittered_times_are_snapped_and_no_hour_is_lost(fine: Telemetry) -> None:
    exact = every(fine, 5)
    offsets = np.array([0, -1, -1, 0]) * MINUTE
    jittered = Telemetry(exact.time + np.resize(offsets, len(exact)), exact.columns)
    log = prepare_log(jittered, SITE)
    assert own_step(jittered.time) == 300.0
    np.testing.assert_array_equal(log.telemetry.time, exact.time)
    np.testing.assert_array_equal(log.telemetry["air_co2"], exact["air_co2"])
    assert any("lay between the times of the grid of 5 min" in note for note in log.notes)


def test_seconds_are_averaged_to_minutes() -> None:
    time = np.datetime64("2020-01-01T00:00:00") + np.arange(600) * np.timedelta64(10, "s")
    table = on_grid(Telemetry(time, {"air_temperature": np.arange(600.0)}))
    assert table.step == 60.0
    assert table["air_temperature"][5] == pytest.approx(np.arange(27, 33).mean())


def test_a_gap_becomes_rows_of_nothing_and_nothing_is_read_ahead_across_it(fine: Telemetry) -> None:
    exact = every(fine, 5)
    kept = np.ones(len(exact), dtype=bool)
    kept[100:200] = False
    log = prepare_log(Telemetry(exact.time[kept], {name: v[kept] for name, v in exact.columns.items()}), SITE)
    assert len(log.telemetry) == len(exact)
    assert np.isnan(log.telemetry["air_temperature"][100:200]).all()
    record = log.record(1.0)
    assert not record.usable[35:65].any()
    assert record.inputs["vent_lee"][33] == pytest.approx(np.mean([*exact["vent_lee"][[99]], exact["vent_lee"][99]]))


def test_weather_by_the_hour_beside_a_climate_by_five_minutes_is_usable(fine: Telemetry) -> None:
    exact = every(fine, 5)
    hourly = np.arange(len(exact)) % 12 == 0
    slow = {name: np.where(hourly, exact[name], np.nan) for name in ("outdoor_temperature", "wind_speed")}
    record = prepare_log(exact.with_columns(slow), SITE).record()
    assert record.usable[:-4].all()


def test_times_without_a_pace_are_read_on_a_grid_that_most_rows_reach(fine: Telemetry) -> None:
    chosen = np.sort(np.random.default_rng(0).choice(len(fine), len(fine) // 6, replace=False))
    log = prepare_log(Telemetry(fine.time[chosen], {name: v[chosen] for name, v in fine.columns.items()}), SITE)
    assert log.telemetry.step in {300.0, 600.0, 720.0, 900.0}
    assert np.isfinite(log.telemetry["air_temperature"]).mean() > 0.7


def test_rows_of_a_clock_that_was_not_set_are_set_aside_and_said(fine: Telemetry) -> None:
    exact = every(fine, 5)
    stray = np.datetime64("1970-01-01T00:00:00") + np.arange(3) * 5 * MINUTE
    time = np.concatenate([stray, exact.time])
    columns = {name: np.concatenate([values[:3], values]) for name, values in exact.columns.items()}
    log = prepare_log(Telemetry(time, columns), SITE)
    np.testing.assert_array_equal(log.telemetry.time, exact.time)
    assert any("3 rows stand months away from all others (1970-01-01)" in note for note in log.notes)


def test_an_interval_counts_from_half_of_its_rows() -> None:
    values = np.array([1.0, 3.0, 9.0, 9.0, 5.0, 0.0, 0.0, 0.0])
    counted = np.array([True, True, False, False, True, False, False, False])
    means, enough = interval_means(values, counted, 4)
    assert enough.tolist() == [True, False]
    assert means.tolist() == [2.0, 0.0]


def test_a_row_a_day_is_refused_in_one_line() -> None:
    time = np.datetime64("2020-01-01T00:00:00") + np.arange(60) * np.timedelta64(1, "D")
    log = prepare_log(
        Telemetry(time, {"air_temperature": np.arange(60.0) % 7, "outdoor_temperature": np.ones(60)}), SITE
    )
    assert [one.kind for one in log.faults] == ["sparse"]
    with pytest.raises(IgrowError, match="every 24 h is too sparse"):
        log.require("a diagnosis")
