"""The network that stands beside the hybrid on measured greenhouses: what it may see, and that it learns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import measured_network
from benchmarks.measured_network import network_predictor
from igrow.core.simulator.hybrid.log_record import make_record
from igrow.core.simulator.hybrid.record import Record
from igrow.core.telemetry import Telemetry
from igrow.trainer.training.stage import TrainingPlan

DAY = 288


@pytest.fixture(autouse=True)
def short_training(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured_network, "PLAN", TrainingPlan(updates=((4, 150), (24, 50))))


def a_record(days: int = 12) -> Record:
    """Air that follows the pipes with a lag of an hour, by rows of 5 min."""
    generator = np.random.default_rng(3)
    count = days * DAY
    pipes = 40.0 + np.repeat(generator.uniform(-15.0, 15.0, count // 36), 36)
    air = np.full(count, 20.0)
    for row in range(1, count):
        air[row] = air[row - 1] + (20.0 + 0.3 * (pipes[row - 1] - 40.0) - air[row - 1]) / 12.0
    time = np.datetime64("2020-01-10T00:00:00") + 300 * np.arange(count) * np.timedelta64(1, "s")
    columns = {"air_temperature": air, "outdoor_temperature": np.full(count, 5.0), "rail_pipe_temperature": pipes}
    return make_record(
        Telemetry(time, columns),
        step=300.0, latitude=52.0, longitude=4.4, mean_height=4.0, lamp_efficacy=1.8, leaf_area_index=2.0,
    )  # fmt: skip


def test_a_run_follows_the_pipes_of_unseen_days_from_any_row_of_the_hour() -> None:
    record = a_record()
    fit = np.arange(len(record)) < 9 * DAY
    starts = 9 * DAY + np.arange(0, 2 * DAY, 37)
    predicted = network_predictor(record, {}, fit)(starts, 24)["air_temperature"]
    truth = record.measured["air_temperature"][starts + 1 + np.arange(24)[:, None]]
    unmoved = record.measured["air_temperature"][starts]
    assert predicted.shape == truth.shape
    assert np.abs(predicted - truth).mean() < 0.5 * np.abs(unmoved - truth).mean()


def test_nothing_measured_outside_the_fit_or_after_a_start_is_seen() -> None:
    record = a_record()
    fit = np.arange(len(record)) < 9 * DAY
    starts = np.array([10 * DAY + 5])
    after = record.measured["air_temperature"].copy()
    after[9 * DAY :] += 7.0
    after[starts] -= 7.0
    other = replace(record, measured=dict(record.measured) | {"air_temperature": after})
    one, two = (network_predictor(each, {}, fit)(starts, DAY)["air_temperature"] for each in (record, other))
    np.testing.assert_array_equal(one, two)
