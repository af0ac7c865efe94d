"""The policy in a plan: what it sees, and what it may do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.onnx_policy import OnnxPolicy
from igrow.core.errors import IgrowError
from igrow.core.quantities import SETPOINTS
from igrow.trainer.research.policies.policy import ACTIONS, OBSERVATIONS, PAPER_SETPOINTS, chosen, observe, to_setpoints
from tests.planner.toy_greenhouse import START


def test_it_sees_76_numbers_and_gives_96() -> None:
    assert (OBSERVATIONS, ACTIONS) == (76, 96)


def test_what_it_sees_is_of_order_one_and_a_missing_state_counts_as_usual(site, weather) -> None:
    forecast = np.repeat(weather[None, :24], 3, axis=0)
    present = {"air_temperature": np.array([18.0, 20.0, 22.0]), "leaf_area_index": np.full(3, 3.0)}
    seen = observe(site, present, forecast, START)
    assert seen.shape == (3, OBSERVATIONS)
    assert seen.dtype == np.float32
    assert np.abs(seen).max() < 3.0
    np.testing.assert_allclose(seen[:, 72], [-0.4, 0.0, 0.4], atol=1e-6)
    np.testing.assert_array_equal(seen[:, 74], 0.0)


def test_every_action_is_within_the_limits(site) -> None:
    actions = np.random.default_rng(0).uniform(-2, 2, (50, ACTIONS)).astype(np.float32)
    setpoints = to_setpoints(site, actions)
    assert setpoints.shape == (50, 24, 4)
    for column, name in enumerate(PAPER_SETPOINTS):
        limits = site.limits[name]
        assert setpoints[..., column].min() == pytest.approx(limits.low)
        assert setpoints[..., column].max() == pytest.approx(limits.high)


def test_lamps_are_on_or_off(site) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (5, ACTIONS)).astype(np.float32)
    assert set(np.unique(to_setpoints(site, actions)[..., PAPER_SETPOINTS.index("lamp_on")])) == {0.0, 1.0}


def test_what_plans_do_not_choose_is_the_recipes(site, recipe) -> None:
    free = replace(site, planning=replace(site.planning, optimise=("heating_setpoint", "lamp_on")))
    setpoints = to_setpoints(site, np.zeros((2, ACTIONS), dtype=np.float32))
    followed = chosen(free, setpoints, recipe[:24])
    for column, name in enumerate(SETPOINTS):
        chosen_here = name in PAPER_SETPOINTS and name in free.planning.optimise
        expected = setpoints[..., PAPER_SETPOINTS.index(name)] if chosen_here else recipe[None, :24, column]
        np.testing.assert_array_equal(followed[..., column], np.broadcast_to(expected, (2, 24)))


def test_a_file_that_is_no_policy_is_refused(tmp_path: Path) -> None:
    from igrow.core.planner import EvolutionSettings
    from igrow.trainer.exporting.optimizer import export_optimizer

    (tmp_path / "a.onnx").write_bytes(export_optimizer(EvolutionSettings()).SerializeToString())
    with pytest.raises(IgrowError, match="is no policy of 76 observations"):
        OnnxPolicy(tmp_path / "a.onnx")
