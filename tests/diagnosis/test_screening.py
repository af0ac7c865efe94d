from __future__ import annotations

import numpy as np

from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis.screening import screen

TIME = np.datetime64("2020-01-01T00:00:00", "s") + np.arange(576) * np.timedelta64(300, "s")


def wavy(level: float, size: float) -> np.ndarray:
    return level + size * np.sin(np.arange(576) / 20.0)


def test_a_spike_and_a_value_out_of_range_are_set_aside_with_their_reason() -> None:
    values = wavy(20.0, 2.0)
    values[100] = 2.0
    values[200] = 99.0
    found = screen(Telemetry(TIME, {"air_temperature": values})).screened
    assert [(one.reason, one.start) for one in found] == [("out of range", TIME[200]), ("spike", TIME[100])]


def test_a_reading_that_stands_still_for_half_a_day_is_set_aside() -> None:
    values = wavy(600.0, 100.0)
    values[100:244] = 512.0
    screened = screen(Telemetry(TIME, {"air_co2": values}))
    assert screened.screened[0].reason == "stuck"
    assert np.isnan(screened.telemetry["air_co2"][100:244]).all()
    assert np.isfinite(screened.telemetry["air_co2"][:100]).all()


def test_saturated_humidity_is_no_stuck_sensor() -> None:
    assert screen(Telemetry(TIME, {"air_humidity": np.full(576, 100.0)})).screened == ()


def test_a_good_log_is_left_as_it_is() -> None:
    log = Telemetry(TIME, {"air_temperature": wavy(20.0, 2.0), "outdoor_temperature": wavy(5.0, 3.0)})
    screened = screen(log)
    assert screened.screened == ()
    assert screened.faults == ()
    np.testing.assert_array_equal(screened.telemetry["air_temperature"], log["air_temperature"])
