from __future__ import annotations

import pytest

from igrow.trainer.diagnosis.diagnose import same_in_all_regimes
from igrow.trainer.diagnosis.result import Interval


@pytest.mark.parametrize(
    ("values", "same"),
    [
        ({}, True),
        ({"night": 0.1}, True),
        ({"day": 0.8, "night": 1.2, "calm": 0.5, "windy": 1.1}, True),
        ({"day": 0.1, "night": 1.2}, False),
        ({"day": -0.9, "night": 1.2}, False),
        ({"day": -0.9, "night": -1.2}, True),
        ({"day": 1.0, "night": 1.0, "vents shut": 3.0, "vents open": 0.4}, False),
    ],
)
def test_a_cause_is_the_same_by_day_and_by_night_in_calm_and_in_wind(values: dict[str, float], same: bool) -> None:
    regimes = {name: Interval(value, value - 0.1, value + 0.1, "1") for name, value in values.items()}
    assert same_in_all_regimes(regimes) is same
