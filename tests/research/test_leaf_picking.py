"""Leaf picking: the rule is found in seasons that were run by one, and applied in free runs as it was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.arrays import Floats
from igrow.core.simulator.leaf_picking import LeafPicking, pick
from igrow.trainer.research.network.leaf_picking import CERTAIN, FADED, fit_picking, followed, picked_area, smooth

HOURS = 60 * 24
HOUR = np.arange(HOURS, dtype=np.float64) % 24.0
READY = np.array([50, 150, 260, 370, 480], dtype=np.float32)
RULE = LeafPicking(12.0, 3.0, 4.0, READY, np.full(5, 0.3, dtype=np.float32), certain=1e3, faded=2e3)


def run(rule: LeafPicking, thermal: Floats, growth: float) -> Floats:
    """Grow leaves at a constant pace and pick by `rule`: (runs, hours)."""
    area, count, rows = np.full(len(thermal), 1.0), np.zeros(len(thermal)), []
    for step in range(HOURS):
        if step:
            age, hour = np.full_like(area, step / 24), np.full_like(area, HOUR[step])
            gone, count = pick(np, rule, area, thermal[:, step], age, hour, count)
            area = area + growth - gone
        rows.append(area)
    return np.stack(rows, axis=1)


@pytest.fixture
def thermal() -> Floats:
    """Thermal time of twelve seasons between 12 and 26 degC."""
    temperature = np.linspace(12, 26, 12)[:, None] + 2 * np.sin(np.arange(HOURS) / 200)[None]
    return np.asarray(np.cumsum(temperature, axis=1) / 24)


def test_leaves_are_picked_only_where_area_age_and_hour_agree() -> None:
    one, age = np.ones(1), np.full(1, 10.0)
    late, early = np.full(1, 4.0 * 10 + 60), np.full(1, 4.0 * 10 + 40)
    noon, count = np.full(1, 12.0), np.zeros(1)
    gone, counted = pick(np, RULE, 4 * one, late, age, noon, count)
    assert gone[0] == pytest.approx(1.2) and counted[0] == 1
    for area, thermal_time, hour in ((2.9, late, noon), (4.0, early, noon), (4.0, late, noon + 1)):
        gone, counted = pick(np, RULE, area * one, thermal_time, age, hour, count)
        assert gone[0] == 0 and counted[0] == 0


def test_pickings_fade_when_their_days_can_no_longer_be_told() -> None:
    rule = LeafPicking(12.0, 3.0, 4.0, READY, np.full(5, 0.3, dtype=np.float32), certain=10.0, faded=20.0)
    area = np.full(3, 4.0)
    gone, _ = pick(np, rule, area, np.full(3, 1e3), np.array([5.0, 15.0, 25.0]), np.full(3, 12.0), np.zeros(3))
    np.testing.assert_allclose(gone, [1.2, 0.6, 0.0])


def test_the_rule_is_found_in_seasons_that_were_run_by_it(thermal: Floats) -> None:
    area = run(RULE, thermal, 0.008)
    found = fit_picking(area, thermal, HOUR)
    assert found is not None
    assert found.hour == RULE.hour
    assert found.threshold == pytest.approx(RULE.threshold, abs=0.2)
    np.testing.assert_allclose(found.share[:3], 0.3, atol=0.02)
    again = run(replace(found, certain=1e3, faded=2e3), thermal, 0.008)
    assert np.abs(again - area).mean() < 0.25 * np.abs(area - smooth(area)).mean()


def test_seasons_in_which_nobody_picks_have_no_rule(thermal: Floats) -> None:
    assert fit_picking(np.cumsum(np.full(thermal.shape, 0.001), axis=1), thermal, HOUR) is None


def test_what_was_picked_is_the_fall_beyond_growth() -> None:
    area = np.array([[1.0, 1.1, 1.2, 0.9, 1.0, 1.1]])
    np.testing.assert_allclose(picked_area(area), [[0, 0, 0, 0.4, 0, 0]])


def test_the_leaf_area_to_learn_goes_from_its_steps_to_its_mean() -> None:
    hours = int(24 * (FADED + 20))
    area = 3 + 0.5 * np.sin(np.arange(hours)[None] / 40)
    learned = followed(area)
    young, old = slice(0, int(24 * CERTAIN)), slice(int(24 * FADED) + 1, None)
    np.testing.assert_array_equal(learned[:, young], area[:, young])
    np.testing.assert_array_equal(learned[:, old], smooth(area)[:, old])
