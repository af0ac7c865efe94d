"""Training of a policy: the environment it learns in, that it learns, and that the graph does what the actor does."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.onnx_policy import OnnxPolicy
from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.trainer.research.policies.policy import ACTIONS, HOURS, OBSERVATIONS
from igrow.trainer.research.policies.train import SETTINGS, export, train
from tests import needs
from tests.planner.toy_greenhouse import ToySimulator

SITE = Site("toy", 52.0, 4.5, "Europe/Amsterdam")


@pytest.fixture
def days():
    needs.package("gymnasium", "research")
    from igrow.trainer.research.policies import days

    return days


def test_the_environment_is_one_of_gymnasium(days) -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(days.SimulatedDays(SITE, ToySimulator()), skip_render_check=True)


def test_levels_of_blocks_become_hours_of_the_day(days) -> None:
    levels = np.arange(days.LEVELS, dtype=np.float32).reshape(8, 4)
    hours = days.by_hour(levels.reshape(1, -1)).reshape(HOURS, 4)
    assert hours.shape == (24, 4)
    # Blocks begin at 0, 4, 7, 10, 13, 16, 19 and 23 o'clock.
    for hour, block in ((0, 0), (3, 0), (4, 1), (9, 2), (18, 5), (22, 6), (23, 7)):
        np.testing.assert_array_equal(hours[hour], levels[block])


def test_a_day_by_the_recipe_is_worth_nothing_more_than_it(days) -> None:
    bound = days.SimulatedDays(replace(SITE, planning=replace(SITE.planning, optimise=())), ToySimulator())
    free = days.SimulatedDays(SITE, ToySimulator())
    action = np.random.default_rng(0).uniform(-1, 1, days.LEVELS).astype(np.float32)
    worth = []
    for one in (bound, free):
        one.reset(seed=1)
        worth.append(one.step(action)[1])
    assert worth[0] == pytest.approx(0.0, abs=1e-9)
    assert abs(worth[1]) > 1e-3


def test_a_day_begins_where_the_one_before_ended_and_an_episode_ends(days) -> None:
    world = days.SimulatedDays(SITE, ToySimulator())
    seen, _ = world.reset(seed=2)
    assert seen.shape == (OBSERVATIONS,)
    ended = []
    for _ in range(days.EPISODE):
        seen, _, over, ends, _ = world.step(np.full(days.LEVELS, -0.1, dtype=np.float32))
        ended.append(ends)
        assert not over
        # The toy's air is as warm as its setpoint, which the last hour of the day left.
        assert seen[72] == pytest.approx((world._start.applied[0] - 20.0) / 5.0, abs=1e-5)
    assert ended == [False] * (days.EPISODE - 1) + [True]


@pytest.mark.slow
def test_it_learns_and_the_graph_does_what_the_actor_does(days, tmp_path: Path) -> None:
    needs.package("stable_baselines3", "research")
    import torch

    torch.set_num_threads(1)
    changes = {"learning_starts": 150, "batch_size": 64, "policy_kwargs": {"net_arch": [32]}}

    def gain(policy: OnnxPolicy) -> float:
        """Return what the policy earns in days that no training has seen, as rewards."""
        world, found = days.SimulatedDays(SITE, ToySimulator(), seed=99), []
        for _ in range(8):
            seen, _ = world.reset()
            action = policy.act(seen[None]).reshape(HOURS, 4)
            _, first = np.unique(days.BLOCKS, return_index=True)
            found.append(world.step(action[first].ravel())[1])
        return float(np.mean(found))

    gains = []
    for count in (1, 700):
        training = train(SITE, ToySimulator(), float("inf"), days=count, settings={**SETTINGS, **changes})
        assert training.days == count
        path = tmp_path / f"{count}.onnx"
        path.write_bytes(export(training.actor).SerializeToString())
        policy = OnnxPolicy(path)
        seen = np.random.default_rng(0).standard_normal((7, OBSERVATIONS)).astype(np.float32)
        with torch.no_grad():
            expected = training.actor(torch.from_numpy(seen), deterministic=True).numpy()
        assert policy.act(seen).shape == (7, ACTIONS)
        np.testing.assert_allclose(policy.act(seen), days.by_hour(expected), atol=1e-5)
        gains.append(gain(policy))
    assert gains[1] > gains[0] + 0.1
    assert gains[1] > 0.0


def test_without_the_library_one_line_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(IgrowError, match=r"stable_baselines3 is not installed; it comes with pip install 'igrow"):
        train(SITE, ToySimulator(), 1.0)
