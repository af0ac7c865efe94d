from __future__ import annotations

import numpy as np

from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.data.screening import screen

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


def test_rows_of_zeros_from_an_outage_are_set_aside_whole() -> None:
    columns = {
        "air_temperature": wavy(20.0, 2.0),
        "air_humidity": wavy(80.0, 5.0),
        "air_co2": wavy(600.0, 100.0),
        "vent_lee": wavy(30.0, 5.0),
        "outdoor_temperature": wavy(5.0, 3.0),
    }
    for values in columns.values():
        values[200:250] = 0.0
    found = screen(Telemetry(TIME, columns))
    assert all(np.isnan(found.telemetry[name][200:250]).all() for name in columns)
    assert all(np.isfinite(found.telemetry[name][:200]).all() for name in columns)
    assert {one.reason for one in found.screened} == {"outage"}
    assert found.notes == ("50 rows in which all sensors read 0 were set aside whole: an outage",)


def test_frost_outside_and_a_dry_air_are_no_outage() -> None:
    log = Telemetry(TIME, {"air_temperature": np.where(wavy(0.0, 1.0) > 0.5, 0.0, 4.0), "air_co2": wavy(600.0, 9.0)})
    assert not any(one.reason == "outage" for one in screen(log).screened)


def test_a_co2_sensor_that_stood_still_for_most_of_the_log_is_set_aside_and_the_rest_is_judged() -> None:
    co2 = wavy(600.0, 100.0)
    co2[200:] = 512.0
    log = Telemetry(TIME, {"air_co2": co2, "air_temperature": wavy(20.0, 2.0), "outdoor_temperature": wavy(5.0, 3.0)})
    found = screen(log)
    assert found.faults == ()
    assert np.isnan(found.telemetry["air_co2"]).all()
    assert any(note.startswith("air_co2: 65 % of its readings") and "nothing is said" in note for note in found.notes)


def test_a_needed_sensor_that_stood_still_for_most_of_the_log_is_a_fault_of_the_data() -> None:
    air = wavy(20.0, 2.0)
    air[200:] = 19.5
    (fault,) = screen(Telemetry(TIME, {"air_temperature": air, "outdoor_temperature": wavy(5.0, 3.0)})).faults
    assert (fault.kind, fault.quantity) == ("sensor", "air_temperature")
    assert "the sensor of air_temperature does not work, 65 % of its readings were set aside (stuck)" in str(fault)


def test_a_part_of_a_log_has_the_stretches_that_lie_in_it() -> None:
    air = wavy(20.0, 2.0)
    air[40] += 30.0
    air[400] += 30.0
    log = prepare_log(Telemetry(TIME, {"air_temperature": air, "outdoor_temperature": wavy(5.0, 3.0)}))
    assert len(log.screened) == 2
    assert [one.start for one in log.select(TIME[200]).screened] == [TIME[400]]
    assert [one.start for one in log.select(None, TIME[200]).screened] == [TIME[40]]
