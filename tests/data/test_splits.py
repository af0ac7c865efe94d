"""Rows for fitting and rows that no step sees never mix."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import folds, held_out_weeks, split_days, weeks
from tests.virtual_log import SITE, virtual_log


def test_whole_weeks_are_held_out() -> None:
    time = np.datetime64("2020-01-01", "s") + np.arange(60 * 288) * np.timedelta64(300, "s")
    held_out, week = held_out_weeks(time), weeks(time)
    assert all(held_out[week == number].all() or not held_out[week == number].any() for number in np.unique(week))
    assert set(week[held_out]) == {3, 7}


@pytest.mark.parametrize("days", [7, 8, 28, 30])
def test_a_cross_validation_holds_out_each_day_once_the_given_days_first(days: int) -> None:
    record = prepare_log(virtual_log(days, seed=3, step=3600.0), SITE).record(0.0)
    given = split_days(record, SITE.longitude)
    turns = folds(given)
    np.testing.assert_array_equal(turns[0].fit, given.fit)
    held = np.sum([~one.fit for one in turns], axis=0)
    np.testing.assert_array_equal(held, np.ones(given.days))
    assert all(2 * one.fit.sum() >= given.days for one in turns)
