"""Sensor quality on measured logs: working sensors are hardly ever doubted, planted faults are found."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from igrow.edge.bus.plc import Reading
from igrow.edge.image import Quality
from igrow.edge.sensors import ImageBuilder, default_rule
from igrow.edge.wiring import sun_elevation
from igrow.trainer.data.open_source import open_source

DAYS = 40
DOUBT = (Quality.FROZEN, Quality.IMPLAUSIBLE, Quality.OUT_OF_RANGE)
SENSORS = (
    "air_temperature", "air_humidity", "air_co2", "par", "outdoor_temperature", "outdoor_humidity", "global_radiation",
    "wind_speed", "vent_lee", "vent_wind", "lamp_power",
)  # fmt: skip


@pytest.fixture(scope="module")
def columns(data_folder):
    log = open_source(data_folder / "agc2019", "Reference").telemetry
    log = log.select(log.time[0], log.time[0] + np.timedelta64(DAYS, "D"))
    seconds = log.time.astype(np.int64).astype(float)
    return seconds, {name: np.array(log[name]) for name in SENSORS if name in log}


def qualities(seconds, columns):
    builder = ImageBuilder(
        {name: default_rule(name, poll_period=300.0) for name in columns}, (), sun_elevation(52.0, 4.5)
    )
    found: dict[str, list[Quality]] = {name: [] for name in columns}
    for row, now in enumerate(seconds):
        readings = {
            name: Reading(float(values[row]), None, now) for name, values in columns.items() if np.isfinite(values[row])
        }
        for name, value in builder.build(readings, now, now).values.items():
            found[name].append(value.quality)
    return found


def test_working_sensors_are_doubted_in_less_than_one_reading_of_two_hundred(columns):
    seconds, values = columns
    for name, found in qualities(seconds, values).items():
        count = Counter(found)
        assert sum(count[quality] for quality in DOUBT) < 0.005 * len(found), (name, count)


def test_planted_faults_are_found(columns):
    seconds, values = columns
    rows = slice(4000, 4200)
    faulty = {name: column.copy() for name, column in values.items()}
    faulty["air_temperature"][rows] = faulty["air_temperature"][4000]
    faulty["air_humidity"][4100] += 40.0 if faulty["air_humidity"][4100] < 55.0 else -40.0
    faulty["air_co2"][rows] = 0.0
    night = np.flatnonzero(values["global_radiation"] < 1.0)[1000:1012]
    faulty["global_radiation"][night] += 400.0
    found = qualities(seconds, faulty)
    # Frozen after three hours, 36 readings of five minutes.
    assert set(found["air_temperature"][4040:4200]) == {Quality.FROZEN}
    assert found["air_temperature"][4205] is Quality.GOOD
    assert found["air_humidity"][4100] is Quality.IMPLAUSIBLE
    assert set(found["air_co2"][rows]) == {Quality.OUT_OF_RANGE}
    assert {found["global_radiation"][row] for row in night} == {Quality.IMPLAUSIBLE}
