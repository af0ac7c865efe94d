"""The learnt policy: what it sees, what it may do, that it learns, and that the graph does what the network does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.planner.policy import ACTIONS, OBSERVATIONS, OnnxPolicy, observe, to_setpoints
from igrow.core.quantities import SETPOINTS
from tests.planner.toy_greenhouse import START, ToySimulator


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
    for column, name in enumerate(SETPOINTS):
        limits = site.limits[name]
        assert setpoints[..., column].min() == pytest.approx(limits.low)
        assert setpoints[..., column].max() == pytest.approx(limits.high)


def test_the_graph_does_what_the_network_does(site, weather, tmp_path: Path) -> None:
    import torch

    from igrow.trainer.research.policies.sac import Actor
    from igrow.trainer.research.policies.train import export

    torch.manual_seed(0)
    actor = Actor((32, 16))
    path = tmp_path / "policy.onnx"
    path.write_bytes(export(actor).SerializeToString())
    policy = OnnxPolicy(path)
    seen = np.random.default_rng(0).standard_normal((7, OBSERVATIONS)).astype(np.float32)
    with torch.no_grad():
        expected = actor(torch.from_numpy(seen)).numpy()
    np.testing.assert_allclose(policy.act(seen), expected, atol=1e-6)
    plan = policy.plan(site, {"air_temperature": 19.0}, weather[:40], START)
    assert plan.shape == (40, 4)
    assert np.isfinite(plan).all()


def test_a_file_that_is_no_policy_is_refused(tmp_path: Path) -> None:
    from igrow.core.planner import EvolutionSettings
    from igrow.trainer.exporting.optimizer import export_optimizer

    (tmp_path / "a.onnx").write_bytes(export_optimizer(EvolutionSettings()).SerializeToString())
    with pytest.raises(IgrowError, match="is no policy of 76 observations"):
        OnnxPolicy(tmp_path / "a.onnx")


def test_the_learner_finds_the_action_that_is_paid() -> None:
    import torch

    from igrow.trainer.research.policies.sac import SacSettings, SoftActorCritic

    settings = replace(SacSettings(), hidden=(32,), batch=64, learning_rate=5e-3, discount=0.0)
    learner = SoftActorCritic(settings, seed=1)
    rng = np.random.default_rng(1)
    wanted = np.where(np.arange(ACTIONS) % 2, 0.6, -0.6)

    def paid(action: np.ndarray) -> np.ndarray:
        return np.asarray(-np.square(action - wanted).mean(axis=1))

    seen = rng.standard_normal((256, OBSERVATIONS)).astype(np.float32)
    before = paid(learner.act(seen, explore=False)).mean()
    random = paid(rng.uniform(-1, 1, (256, ACTIONS))).mean()
    torch.set_num_threads(1)
    for _ in range(8):
        action = learner.act(seen, explore=True)
        learner.memory.add(seen, action, paid(action), seen, False)
        for _ in range(30):
            learner.learn()
    after = paid(learner.act(seen, explore=False)).mean()
    assert after > before / 2
    assert after > random / 2


def test_greenhouses_of_an_environment_are_the_same_for_the_same_seed(site) -> None:
    from igrow.trainer.research.policies.environment import DailyGreenhouses, Scenario
    from igrow.trainer.research.policies.train import first_actions

    actions = first_actions(np.random.default_rng(0), 2)
    worth = []
    for seed in (3, 3, 4):
        world = DailyGreenhouses(site, Scenario(START, 1, 2, seed))
        seen = world.observe()
        valuation = world.step(to_setpoints(site, actions))
        assert world.done
        worth.append((seen, valuation.score))
    np.testing.assert_array_equal(worth[0][0], worth[1][0])
    np.testing.assert_array_equal(worth[0][1], worth[1][1])
    assert (worth[0][1] != worth[2][1]).all()


def test_trials_of_one_course_share_what_they_see_and_the_first_is_followed(site) -> None:
    from igrow.trainer.research.policies.environment import Scenario, SimulatedDays

    world = SimulatedDays(site, Scenario(START, 2, 6, seed=1), ToySimulator(), trials=3)
    seen = world.observe()
    assert seen.shape == (6, OBSERVATIONS)
    np.testing.assert_array_equal(seen[0], seen[2])
    assert (seen[0] != seen[3]).any()
    actions = np.zeros((6, ACTIONS), dtype=np.float32)
    actions[0] = -0.1875
    setpoints = to_setpoints(site, actions)
    score = world.step(setpoints).score
    assert score.shape == (1, 6)
    assert score[0, 0] != score[0, 1]
    assert score[0, 1] == score[0, 2]
    # The toy's air is as warm as its setpoint, so the next day begins with that of the first trial.
    expected = (setpoints[0, -1, 0] - 20.0) / 5.0
    np.testing.assert_allclose(world.observe()[:3, 72], expected, rtol=1e-6)
    assert not world.done
