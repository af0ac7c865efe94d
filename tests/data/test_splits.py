"""Rows for fitting and rows that no step sees never mix."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.trainer.data.splits import alternate_weeks, split_weeks, weeks


def test_the_weeks_of_a_split_never_mix() -> None:
    time = np.datetime64("2020-01-01", "s") + np.arange(60 * 288) * np.timedelta64(300, "s")
    for split in (split_weeks(time, 3, 2), alternate_weeks(time)):
        together = split.fit.astype(int) + split.selection + split.held_out
        assert (together == 1).all()
        for rows in (split.fit, split.selection, split.held_out):
            week = weeks(time)
            assert all(rows[week == number].all() or not rows[week == number].any() for number in np.unique(week))
    with pytest.raises(IgrowError, match="leave none to test"):
        split_weeks(time, 9, 1)
