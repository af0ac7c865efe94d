"""Days under a figure: a few, for logs of any length, and no complaint of a library."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from igrow.core.language import ENGLISH
from igrow.trainer.figure_style import date_axis, panels, svg


@pytest.mark.parametrize(
    "hours", [2, 7, 30, 49, 71, 100, 24 * 12, 24 * 40, 24 * 62, 24 * 88, 24 * 166, 24 * 900, 24 * 1050]
)
def test_a_log_of_any_length_has_a_few_days_under_it(hours: int) -> None:
    figure, (axes,) = panels()
    time = np.datetime64("2020-02-01T00:00:00", "s") + np.arange(hours + 1) * np.timedelta64(3600, "s")
    axes.plot(time, np.zeros(len(time)))
    date_axis(axes, ENGLISH)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        svg(figure)
    assert 2 <= len(axes.get_xticks()) <= 9
