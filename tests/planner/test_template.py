"""Genes to setpoints: blocks of local hours, limits, slew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.core.planner.template import BLOCK_STARTS, for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Site
from tests.setpoint_tables import OPTIONAL

SITE = Site("toy", 52.0, 4.5, "Europe/Amsterdam")
MIDNIGHT = np.datetime64("2020-02-01T23:00:00", "s")
UNKNOWN = np.full(len(SETPOINTS), np.nan)


def test_a_block_holds_from_its_local_hour_to_the_next_and_the_last_day_is_like_the_one_before() -> None:
    template = for_site(SITE, MIDNIGHT, 72)
    assert template.genes == 2 * 2 * len(BLOCK_STARTS) + 48
    for name in ("heating_setpoint", "co2_setpoint"):
        changes = np.flatnonzero(np.diff(template.block[name])) + 1
        assert changes[:16].tolist() == [4, 7, 10, 13, 16, 19, 23, 24, 28, 31, 34, 37, 40, 43, 47, 48]
        np.testing.assert_array_equal(template.block[name][48:], template.block[name][24:48])
    lamps = list(range(48))
    assert template.block["lamp_on"].tolist() == lamps + lamps[24:], "the night's dark hours end at any hour"


@pytest.mark.parametrize("hours", [24, 48])
def test_one_or_two_days_have_the_genes_of_one(hours: int) -> None:
    assert for_site(SITE, MIDNIGHT, hours).genes == 2 * len(BLOCK_STARTS) + 24


def test_lamps_are_drawn_in_stretches() -> None:
    """Of hours drawn one by one half would burn, and none of a hundred candidates twelve in a row."""
    template = for_site(SITE, MIDNIGHT, 48)
    lamps = template.draw(np.random.default_rng(0), 100)[:, template.place_of("lamp_on")]
    assert (np.abs(np.diff(lamps, axis=1)).sum(axis=1) <= 2).all()
    assert {0.0, 24.0} < set(lamps.sum(axis=1).tolist())


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 23), st.integers(24, 72))
def test_every_candidate_stays_within_limits_and_slew(seed: int, hour: int, hours: int) -> None:
    rng = np.random.default_rng(seed)
    template = for_site(SITE, MIDNIGHT + np.timedelta64(hour, "h"), hours)
    genes = rng.random((5, template.genes), dtype=np.float32)
    recipe = rng.uniform(-50, 2000, size=(hours, len(SETPOINTS)))
    applied = np.array([19.0, 500.0, 0.0, 0.2, *OPTIONAL])
    setpoints = template.decode(genes, recipe, applied)
    assert setpoints.shape == (5, hours, len(SETPOINTS))
    for column, name in enumerate(SETPOINTS):
        limits = SITE.limits[name]
        assert setpoints[..., column].min() >= limits.low
        assert setpoints[..., column].max() <= limits.high
        if limits.slew is not None:
            before = np.full((5, 1), applied[column])
            assert np.abs(np.diff(setpoints[..., column], axis=1, prepend=before)).max() <= limits.slew + 1e-9


def test_what_is_not_free_follows_the_recipe() -> None:
    template = for_site(SITE, MIDNIGHT, 24)
    columns = [np.full(24, 20.0), np.full(24, 500.0), np.zeros(24), np.linspace(0, 0.5, 24)]
    columns += [np.full(24, value) for value in OPTIONAL]
    recipe = np.column_stack(columns)
    setpoints = template.decode(np.ones((1, template.genes), dtype=np.float32), recipe, UNKNOWN)
    assert "irrigation_on" not in template.free
    np.testing.assert_array_equal(setpoints[0, :, 3], recipe[:, 3])


def test_a_schedule_in_blocks_survives_encoding() -> None:
    template = for_site(SITE, MIDNIGHT, 48)
    genes = np.random.default_rng(0).random((1, template.genes), dtype=np.float32)
    recipe = np.tile([18.0, 400.0, 0.0, 0.1, *OPTIONAL], (48, 1))
    first = template.decode(genes, recipe, UNKNOWN)[0]
    unlimited = template.encode(first)
    again = template.decode(unlimited[None], recipe, UNKNOWN)[0]
    # Where a limit rounds a corner the block's mean differs; elsewhere the value returns.
    assert np.median(np.abs(again - first)[:, 2]) == 0.0
    assert np.median(np.abs(again - first)[:, 0]) <= 0.5
