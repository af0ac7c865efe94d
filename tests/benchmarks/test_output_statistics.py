"""What forecasts usually miss with the weather is taken off, and nothing measured after the start enters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.forecasts.combination import Combination
from benchmarks.forecasts.output_statistics import all_runs, corrected_runs, fit_output_statistics
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.fit.actuation import setpoint_columns
from tests.virtual_log import SITE, virtual_log

DAY = 288


@pytest.fixture(scope="module")
def greenhouse() -> tuple[Record, dict[str, np.ndarray]]:
    log = virtual_log(16, seed=11)
    record = site_record(log, SITE, 300.0)
    return record, setpoint_columns(log, record, SITE)[0]


def too_cold_in_the_sun(record: Record):
    """A predictor that knows the truth but for 0.01 K for each W/m2 of radiation."""

    def predict(starts: np.ndarray, steps: int) -> dict[str, np.ndarray]:
        rows = starts + 1 + np.arange(steps)[:, None]
        off = 0.01 * record.inputs["global_radiation"][rows]
        return {"air_temperature": record.measured["air_temperature"][rows] - off}

    return predict


def nothing_combined() -> dict[str, Combination]:
    return {"air_temperature": Combination(np.zeros(4), np.zeros(4), np.zeros(4))}


def test_an_error_that_goes_with_the_weather_is_taken_off_on_days_not_seen(greenhouse) -> None:
    record, setpoints = greenhouse
    predict = too_cold_in_the_sun(record)
    early = np.arange(DAY, 10 * DAY, 30)
    late = np.arange(11 * DAY, 14 * DAY, 30)
    runs = all_runs(record, predict, predict, nothing_combined(), early, DAY)
    correction = fit_output_statistics(record, setpoints, runs, early)
    fresh = all_runs(record, predict, predict, nothing_combined(), late, DAY)
    corrected = corrected_runs(record, setpoints, correction, fresh, late)["air_temperature"]
    measured = record.measured["air_temperature"][late + 1 + np.arange(DAY)[:, None]]
    before = np.nanmean(np.abs(measured - fresh["air_temperature"].combined))
    after = np.nanmean(np.abs(measured - corrected))
    assert before > 0.2
    assert after < 0.5 * before


def test_what_was_measured_after_the_start_does_not_change_a_forecast(greenhouse) -> None:
    record, setpoints = greenhouse
    predict = too_cold_in_the_sun(record)
    early = np.arange(DAY, 10 * DAY, 30)
    runs = all_runs(record, predict, predict, nothing_combined(), early, DAY)
    correction = fit_output_statistics(record, setpoints, runs, early)
    start = np.array([12 * DAY + 100])
    fresh = all_runs(record, predict, predict, nothing_combined(), start, 2 * DAY)
    forecast = corrected_runs(record, setpoints, correction, fresh, start)["air_temperature"]
    later = record.measured["air_temperature"].copy()
    later[start[0] + 1 :] += 5.0
    changed = replace(record, measured={**record.measured, "air_temperature": later})
    again = corrected_runs(changed, setpoints, correction, fresh, start)["air_temperature"]
    np.testing.assert_array_equal(forecast, again)
    np.testing.assert_array_equal(forecast[DAY:], fresh["air_temperature"].combined[DAY:])
    assert (forecast[:DAY] != fresh["air_temperature"].combined[:DAY]).any()
