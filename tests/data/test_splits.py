"""Rows for fitting and rows that no step sees never mix."""

from __future__ import annotations

import numpy as np

from igrow.trainer.data.splits import held_out_weeks, weeks


def test_whole_weeks_are_held_out() -> None:
    time = np.datetime64("2020-01-01", "s") + np.arange(60 * 288) * np.timedelta64(300, "s")
    held_out, week = held_out_weeks(time), weeks(time)
    assert all(held_out[week == number].all() or not held_out[week == number].any() for number in np.unique(week))
    assert set(week[held_out]) == {3, 7}
