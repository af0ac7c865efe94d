"""How far off a sensor can have been: no air holds more vapour than it can carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.design.possible_air import amplitude_bounds, is_constant
from tests.diagnosis.conftest import DAYS, STEP


@pytest.fixture(scope="module")
def record(quiet_log: Log) -> Record:
    return quiet_log.record(0.0)


def with_readings(record: Record, quantity: str, values: np.ndarray) -> Record:
    return replace(record, measured={**record.measured, quantity: values})


def test_a_sensor_that_shows_air_as_saturated_cannot_read_too_little(record: Record) -> None:
    offset = EFFECTS["humidity_offset"]
    damp = with_readings(record, "air_humidity", np.linspace(60.0, 96.0, len(record)))
    low, high = amplitude_bounds(offset, damp)
    assert low == pytest.approx(-4.0, abs=0.5)
    assert high == offset.amplitude.high
    full = with_readings(record, "air_humidity", np.full(len(record), 100.0))
    assert amplitude_bounds(offset, full)[0] == 0.0


def test_what_the_sensor_read_before_it_was_off_binds_nothing(record: Record) -> None:
    values = np.where(np.arange(len(record)) < len(record) // 2, 99.0, 88.0)
    seen = with_readings(record, "air_humidity", values)
    acts = np.arange(len(record)) >= len(record) // 2
    assert amplitude_bounds(EFFECTS["humidity_offset"], seen)[0] == pytest.approx(-1.0)
    assert amplitude_bounds(EFFECTS["humidity_offset"], seen, acts)[0] == pytest.approx(-12.0)


def test_no_greenhouse_is_emptier_of_co2_than_a_crop_can_make_it(record: Record) -> None:
    low, high = amplitude_bounds(EFFECTS["co2_offset"], with_readings(record, "air_co2", np.full(len(record), 260.0)))
    assert low == EFFECTS["co2_offset"].amplitude.low
    assert high == pytest.approx(160.0)


def test_a_log_without_readings_and_all_other_effects_keep_the_bounds_of_the_catalogue(record: Record) -> None:
    silent = with_readings(record, "air_humidity", np.full(len(record), np.nan))
    for name, effect in EFFECTS.items():
        if name != "co2_offset":
            assert amplitude_bounds(effect, silent) == (effect.amplitude.low, effect.amplitude.high)
    assert {name for name, effect in EFFECTS.items() if is_constant(effect)} == {"humidity_offset", "co2_offset"}


def test_a_true_offset_lies_within(record: Record) -> None:
    """Whatever air there was, what a sensor read of it with its offset allows that offset."""
    rng = np.random.default_rng(3)
    for true in (-20.0, -3.0, 0.0, 8.0):
        air = np.clip(85.0 + 10.0 * rng.standard_normal(round(DAYS * 86_400 / STEP)), 20.0, 100.0)[: len(record)]
        seen = with_readings(record, "air_humidity", air + true)
        low, high = amplitude_bounds(EFFECTS["humidity_offset"], seen)
        assert low <= true <= high
