"""Intervals of predictions, and the range of the training data."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.research.forecasts.uncertainty import error_growth, training_range


def test_intervals_cover_new_errors_of_the_same_kind() -> None:
    generator = np.random.default_rng(1)
    hours = np.arange(1, 97) / 4.0
    sun = np.where((hours % 24.0 > 8.0)[:, None], 300.0, 0.0) + np.zeros((96, 400))
    size = (0.2 + 0.05 * np.sqrt(hours))[:, None] * np.where(sun > 0, 2.0, 1.0)
    error = size * generator.standard_normal((96, 400))
    growth = error_growth(error[:, :200], hours, sun[:, :200])
    low, high = growth.interval(np.zeros((96, 200)), hours[:, None], sun[:, 200:])
    inside = (error[:, 200:] >= low) & (error[:, 200:] <= high)
    assert 0.87 < inside.mean() < 0.93
    assert 0.85 < inside[sun[:, 0] > 0].mean() < 0.95


def test_errors_that_grow_give_intervals_that_grow() -> None:
    generator = np.random.default_rng(2)
    hours = np.arange(1, 97) / 4.0
    growth = error_growth(hours[:, None] * generator.standard_normal((96, 300)), hours, np.zeros((96, 300)))
    width = growth.high[0] - growth.low[0]
    assert (np.diff(width[1:]) > 0.0).all()


def test_training_rows_are_inside_and_what_was_never_seen_is_outside() -> None:
    generator = np.random.default_rng(3)
    temperature = generator.normal(20.0, 2.0, 5000)
    drivers = {
        "air_temperature": temperature,
        "air_humidity": 80.0 - 3.0 * (temperature - 20.0) + generator.normal(0.0, 1.0, 5000),
        "lamp_on": np.zeros(5000),
    }
    known = training_range(drivers)
    assert known.names == ("air_temperature", "air_humidity")
    assert (known.excess(np, drivers) > 0.0).mean() < 0.012
    outside = known.excess(np, {"air_temperature": 40.0, "air_humidity": 80.0})
    against = known.excess(np, {"air_temperature": 23.0, "air_humidity": 89.0})
    assert outside > 0.5
    assert against > 0.5, "each within its bounds, but never together"
    assert known.excess(np, {"air_temperature": 20.0, "air_humidity": 80.0}) == pytest.approx(0.0)
