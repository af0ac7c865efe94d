"""Rows for fitting and rows that no step sees never mix."""

from __future__ import annotations

import numpy as np

from igrow.trainer.data.splits import alternate_weeks, weeks


def test_the_weeks_of_a_split_never_mix() -> None:
    time = np.datetime64("2020-01-01", "s") + np.arange(60 * 288) * np.timedelta64(300, "s")
    split, week = alternate_weeks(time), weeks(time)
    together = split.fit.astype(int) + split.selection + split.held_out
    assert (together == 1).all()
    for rows in (split.fit, split.selection, split.held_out):
        assert all(rows[week == number].all() or not rows[week == number].any() for number in np.unique(week))
    assert set(week[split.held_out]) == {3, 7}
