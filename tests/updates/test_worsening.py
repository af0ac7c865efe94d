"""A bundle that predicts worse than it did is told of, with the day on which that began; chance is not."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.edge.updates.worsening import DAY, find_worsening, worsening_sentence


def course(
    daily: list[float], *, every: float = 6.0, quantity: str = "air_temperature"
) -> list[tuple[float, dict[str, float]]]:
    """Live errors several times a day; each is of the day before it."""
    times = np.arange(DAY, (len(daily) + 1) * DAY, every * 3600.0)
    return [(float(time), {f"{quantity} 24_h": daily[int(time // DAY) - 1], f"{quantity} 1_h": 0.1}) for time in times]


def test_a_step_is_dated_to_its_day() -> None:
    (found,) = find_worsening(course([0.30, 0.35, 0.28, 0.33, 0.31, 0.3, 0.36, 0.29, 0.9, 1.1, 1.0]))
    assert found.quantity == "air_temperature"
    assert found.since == pytest.approx(8 * DAY, abs=1.01 * DAY)
    assert found.before == pytest.approx(0.314)
    assert found.now == pytest.approx(1.0)


def test_an_odd_day_before_the_change_does_not_date_it() -> None:
    """The errors of a greenhouse in which something broke on the tenth day, after one day of odd weather."""
    well = [0.285, 0.346, 0.216, 0.374, 0.348, 0.338, 0.564, 0.298, 0.310, 0.447]
    (found,) = find_worsening(course([*well, 2.425, 2.353, 1.920]))
    assert found.since == 10 * DAY
    assert found.now == pytest.approx(2.233, abs=0.001)


@pytest.mark.parametrize("size", [1.8, 3.0])
def test_steps_are_dated_within_two_days(size: float) -> None:
    rng = np.random.default_rng(4)
    late = []
    for _ in range(200):
        daily = 0.3 * np.exp(0.25 * rng.normal(size=26))
        daily[14:] *= size
        late += [one.since / DAY - 14.0 for one in find_worsening(course(list(daily), every=24.0))]
    assert len(late) > 150
    assert np.mean(np.abs(late) <= 2.0) > 0.9
    assert abs(np.mean(late)) < 0.5


def test_a_slow_decline_is_found_too() -> None:
    rng = np.random.default_rng(2)
    daily = [0.3 * (1.0 + 0.05 * max(0, day - 10)) + 0.03 * rng.normal() for day in range(40)]
    (found,) = find_worsening(course(daily))
    assert 8 * DAY < found.since < 22 * DAY


def test_what_was_worse_and_is_well_again_is_not_told() -> None:
    assert not find_worsening(course([0.3, 0.35, 0.28, 0.33, 0.31, 1.2, 1.3, 1.2] + 40 * [0.25]))


def test_chance_is_seldom_taken_for_a_change() -> None:
    """Eight weeks of errors that scatter by a quarter, lognormal."""
    rng = np.random.default_rng(1)
    told = [
        bool(find_worsening(course(list(0.3 * np.exp(0.25 * rng.normal(size=56))), every=24.0))) for _ in range(300)
    ]
    assert np.mean(told) < 0.03


def test_few_days_and_lost_errors_say_nothing() -> None:
    assert not find_worsening([])
    assert not find_worsening(course([0.3, 0.3, 0.3, 0.3, 3.0]))
    assert not find_worsening([(float(day) * DAY, {}) for day in range(20)])
    assert not find_worsening(course([float("nan")] * 12))


def test_the_sentence_says_since_when_and_how_much() -> None:
    told = worsening_sentence(find_worsening(course([0.3, 0.35, 0.28, 0.33, 0.31, 0.3, 0.36, 0.29, 0.9, 1.1, 1.0])))
    assert "worse since 1970-01-" in told
    assert "air_temperature 0.314 K -> 1 K" in told
    assert "\n" not in told
