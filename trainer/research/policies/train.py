"""Train a policy and write policy.onnx: `igrow-trainer policy --site site.yaml --out policy.onnx`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import ModelProto, TensorProto, helper, numpy_helper
from torch import nn

from igrow.core.bundle import read_bundle
from igrow.core.planner.objective import Simulator
from igrow.core.planner.policy import ACTIONS, OBSERVATIONS, to_setpoints
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site, load_site
from igrow.trainer.exporting.wiring import finished_model
from igrow.trainer.research.policies.environment import DailyGreenhouses, Scenario, SimulatedDays, World
from igrow.trainer.research.policies.sac import Actor, SacSettings, SoftActorCritic

EXAMPLE = "igrow-trainer policy --site config/site.yaml --bundle igrow_core/default_bundle --out policy.onnx"
TRAINING_SEEDS = 1_000_000
"""Seeds of training weather begin here; tests use smaller ones, so that no season is in both."""
FIRST_START = np.datetime64("2020-01-04T23:00:00", "s")
LAST_START_DAYS = 110
"""Episodes begin on a day up to this long after the first start."""


@dataclass(frozen=True)
class TrainingPlan:
    """How long and on how much."""

    episodes: int = 12
    days: int = 10
    count: int = 256
    """Greenhouses at once."""
    steps_per_day: int = 100
    """Gradient steps after each day of all greenhouses."""
    seconds: float = float("inf")
    """Training ends after the episode in which this time is over."""


def train(
    site: Site,
    plan: TrainingPlan,
    settings: SacSettings,
    seed: int,
    progress: Callable[[str], None] = lambda _: None,
    simulator: Simulator | None = None,
) -> SoftActorCritic:
    """Return a learner after its episodes; every episode has new weather, greenhouses and dates.

    It learns in a simulator where one is given, else in mechanistic greenhouses.
    """
    learner = SoftActorCritic(settings, seed)
    rng = np.random.default_rng(seed)
    began = time.monotonic()
    for episode in range(plan.episodes):
        start = FIRST_START + int(rng.integers(LAST_START_DAYS)) * np.timedelta64(1, "D")
        scenario = Scenario(start, plan.days, plan.count, TRAINING_SEEDS + 1000 * seed + episode)
        world: World = (
            DailyGreenhouses(site, scenario) if simulator is None else SimulatedDays(site, scenario, simulator)
        )
        rewards = []
        while not world.done:
            observation = world.observe()
            first = episode == 0
            action = first_actions(rng, len(observation)) if first else learner.act(observation, explore=True)
            reward = world.step(to_setpoints(site, action)).score.mean(axis=0)
            learner.memory.add(observation, action, reward, world.observe(), not world.done)
            rewards.append(reward.mean())
            if len(learner.memory) >= settings.batch:
                for _ in range(plan.steps_per_day):
                    learner.learn()
        seconds = time.monotonic() - began
        progress(f"episode {episode + 1:3d}  {np.mean(rewards):+.4f} EUR/m2 a day  {seconds:6.0f} s")
        if seconds > plan.seconds:
            break
    return learner


def first_actions(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Return actions (N, 96) to begin with: each setpoint at two random levels, by day and by night, with noise.

    Independent hours would all have the same mean, and the critics would never see a cold night or a dark day.
    """
    hours = np.arange(24)
    day = (hours[None] >= rng.integers(0, 10, (count, 1))) & (hours[None] < rng.integers(14, 24, (count, 1)))
    levels = rng.uniform(-1.0, 1.0, (2, count, 1, 4))
    actions = np.where(day[:, :, None], levels[0], levels[1]) + 0.3 * rng.standard_normal((count, 24, 4))
    return np.asarray(np.clip(actions, -1.0, 1.0).reshape(count, ACTIONS), dtype=np.float32)


def export(actor: Actor) -> ModelProto:
    """Return policy.onnx: `observation` (batch, 76) to `action` (batch, 96), -1 to 1."""
    nodes, weights, tensor = [], [], "observation"
    layers = [layer for layer in actor.body if isinstance(layer, nn.Linear)]
    for number, layer in enumerate(layers):
        last = number == len(layers) - 1
        # The second half of the last layer is the spread of exploration, which a policy in use has not.
        rows = slice(0, ACTIONS) if last else slice(None)
        for kind, array in (("weight", layer.weight[rows].T), ("bias", layer.bias[rows])):
            values = np.ascontiguousarray(array.detach().numpy(), dtype=np.float32)
            weights.append(numpy_helper.from_array(values, f"{kind}_{number}"))
        nodes.append(helper.make_node("Gemm", [tensor, f"weight_{number}", f"bias_{number}"], [f"layer_{number}"]))
        tensor = "action" if last else f"hidden_{number}"
        nodes.append(helper.make_node("Tanh" if last else "Relu", [f"layer_{number}"], [tensor]))
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", OBSERVATIONS])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", ACTIONS])],
        weights,
    )
    return finished_model(graph, [])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Define the options of `igrow-trainer policy`."""
    parser.add_argument("--site", type=Path, required=True, help="site file")
    parser.add_argument("--out", type=Path, required=True, help="policy.onnx to write")
    parser.add_argument("--bundle", type=Path, help="learn in this bundle's simulator, not in mechanistic greenhouses")
    parser.add_argument("--minutes", type=float, default=8.0, help="training ends soon after (default: 8)")
    parser.add_argument("--seed", type=int, default=0, help="of networks, weather and exploration (default: 0)")


def run(arguments: argparse.Namespace) -> int:
    """Train and write the policy; returns the exit code."""
    torch.set_num_threads(1)
    plan = TrainingPlan(episodes=1000, seconds=60.0 * arguments.minutes)
    site = load_site(arguments.site)
    simulator = None
    if arguments.bundle:
        simulator = BundleSimulator(read_bundle(arguments.bundle), site.greenhouse, members=1)
    learner = train(site, plan, SacSettings(), arguments.seed, _say, simulator)
    arguments.out.write_bytes(export(learner.actor).SerializeToString())
    print(f"{arguments.out} written")
    return 0


def _say(line: str) -> None:
    print(line, flush=True)
