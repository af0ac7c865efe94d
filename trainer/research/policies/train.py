"""Train a policy by soft actor-critic and write policy.onnx: `igrow-trainer policy --site site.yaml --out policy.onnx`.

The learner is stable-baselines3's (`pip install 'igrow[research]'`; Raffin and others 2021, J. Mach. Learn. Res. 22,
268), of the algorithm of Haarnoja and others (2018, arXiv:1812.05905).
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from onnx import ModelProto, TensorProto, helper, numpy_helper
from torch import nn

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.simulator.outcome import Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site, load_site
from igrow.trainer.exporting.wiring import finished_model
from igrow.trainer.progress import Progress, silent
from igrow.trainer.research.policies.policy import ACTIONS, OBSERVATIONS

EXAMPLE = "igrow-trainer policy --site config/site.yaml --out policy.onnx"
SETTINGS: dict[str, Any] = {
    "learning_rate": 5e-4,
    "buffer_size": 200_000,
    "learning_starts": 1500,
    "batch_size": 256,
    "gamma": 0.5,
    "ent_coef": "auto_0.05",
    "target_entropy": -32.0,
    "policy_kwargs": {"net_arch": [256, 256]},
}
"""Of the learner, where not the library's own. A day's setpoints act little beyond the day that follows; entropy begins
small beside the reward, which is of order 1 (`days.EUROS`)."""


@dataclass
class Training:
    """What came of a training."""

    actor: nn.Module
    """stable-baselines3's."""
    days: int
    """Simulated, each one step of the learner."""
    gains: list[float] = field(default_factory=list)
    """EUR m-2 a day more than the recipe, mean over each `REPORTED` days as they were explored."""
    seconds: float = 0.0
    """Of the processor."""


REPORTED = 500
"""Days between two reports."""


def train(
    site: Site,
    simulator: Simulator,
    seconds: float,
    *,
    days: int = 10_000_000,
    seed: int = 0,
    progress: Progress = silent,
    settings: dict[str, Any] | None = None,
) -> Training:
    """Return a policy that learnt in a simulator for so many seconds of the processor, or days of the simulator.

    Raises:
        IgrowError: stable-baselines3 is not installed.
    """
    try:
        from stable_baselines3 import SAC  # noqa: PLC0415 - an optional extra
        from stable_baselines3.common.callbacks import BaseCallback  # noqa: PLC0415

        from igrow.trainer.research.policies.days import EUROS, SimulatedDays  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise IgrowError(f"{error.name} is not installed; it comes with pip install 'igrow[research]'") from None
    began = time.process_time()
    learner = SAC("MlpPolicy", SimulatedDays(site, simulator, seed), seed=seed, device="cpu", **(settings or SETTINGS))
    training = Training(learner.actor, 0)
    rewards: list[float] = []

    class Clock(BaseCallback):  # type: ignore[misc]
        """Ends the training when its time is over."""

        def _on_step(self) -> bool:
            rewards.append(float(np.mean(self.locals["rewards"])))
            training.seconds = time.process_time() - began
            if len(rewards) == REPORTED:
                training.gains.append(float(np.mean(rewards)) / EUROS)
                rewards.clear()
                progress(f"{self.num_timesteps:7d} days {training.gains[-1]:+.4f} EUR/m2 {training.seconds:6.0f} s")
            return training.seconds < seconds

    learner.learn(days, callback=Clock())
    training.days = int(learner.num_timesteps)
    return training


def export(actor: Any) -> ModelProto:
    """Return policy.onnx of stable-baselines3's actor: `observation` (batch, 76) to `action` (batch, 96), -1 to 1.

    The mean action, without the spread of exploration; each hour says what its block of the day says.
    """
    from igrow.trainer.research.policies.days import LEVELS, by_hour  # noqa: PLC0415 - with gymnasium, an extra

    rows = by_hour(np.arange(LEVELS, dtype=np.float32)[None])[0].astype(int)
    layers = [layer for layer in actor.latent_pi if isinstance(layer, nn.Linear)]
    nodes, weights, tensor = [], [], "observation"
    for number, layer in enumerate([*layers, actor.mu]):
        last = number == len(layers)
        weight, bias = layer.weight.detach().numpy().T, layer.bias.detach().numpy()
        for kind, array in (("weight", weight[:, rows] if last else weight), ("bias", bias[rows] if last else bias)):
            weights.append(numpy_helper.from_array(np.ascontiguousarray(array), f"{kind}_{number}"))
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
    parser.add_argument("--bundle", type=Path, default=default_bundle_folder(), help="in whose simulator it learns")
    parser.add_argument("--minutes", type=float, default=15.0, help="of the processor (default: 15)")
    parser.add_argument("--seed", type=int, default=0, help="of networks, weather and exploration (default: 0)")


def run(arguments: argparse.Namespace) -> int:
    """Train and write the policy; returns the exit code."""
    torch.set_num_threads(1)
    site = load_site(arguments.site)
    simulator = BundleSimulator(read_bundle(arguments.bundle), site.greenhouse, members=1)
    say = partial(print, flush=True)
    training = train(site, simulator, 60.0 * arguments.minutes, seed=arguments.seed, progress=say)
    arguments.out.write_bytes(export(training.actor).SerializeToString())
    print(f"{arguments.out} written")
    return 0
