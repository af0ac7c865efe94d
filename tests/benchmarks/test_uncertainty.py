"""Intervals of predictions."""

from __future__ import annotations

import numpy as np

from benchmarks.forecasts.uncertainty import error_growth


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
