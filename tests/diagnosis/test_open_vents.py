"""What a CO2 sensor must read under wide open vents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.open_vents import under_open_vents
from igrow.trainer.diagnosis.rules import DEFAULT


def reading(log: Log, first: float, last: float) -> Record:
    """A log with vents wide open at noon, and a CO2 sensor that reads so far off the outdoor air then."""
    record = log.record(0.0)
    hour = np.asarray(record.inputs["hour"])
    opened = np.where((hour > 10.0) & (hour < 16.0), 80.0, 0.0)
    off = np.linspace(first, last, len(record))
    inputs = {**record.inputs, "vent_lee": opened, "vent_wind": opened}
    return replace(record, inputs=inputs, measured={**record.measured, "air_co2": record.inputs["outdoor_co2"] + off})


@pytest.mark.parametrize(
    ("first", "last", "is_offset"),
    [(-180.0, -170.0, True), (-180.0, -230.0, True), (0.0, -170.0, False), (-20.0, -25.0, False), (120.0, 120.0, True)],
)
def test_an_offset_stands_from_the_first_days_on_and_a_drift_does_not(
    quiet_log: Log, first: float, last: float, *, is_offset: bool
) -> None:
    opened = under_open_vents(reading(quiet_log, first, last), DEFAULT)
    assert opened is not None
    assert opened.is_offset(DEFAULT) is is_offset


def test_its_sentence_says_how_far_off(quiet_log: Log) -> None:
    opened = under_open_vents(reading(quiet_log, -175.0, -175.0), DEFAULT)
    assert opened is not None and "reads 175 ppm below the outdoor air" in opened.sentence


def test_shut_vents_tell_nothing(quiet_log: Log) -> None:
    record = quiet_log.record(0.0)
    shut = {**record.inputs, "vent_lee": np.zeros(len(record)), "vent_wind": np.zeros(len(record))}
    assert under_open_vents(replace(record, inputs=shut), DEFAULT) is None
