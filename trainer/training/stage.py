"""Training of one network stage: windows of many steps, run freely, with a curriculum of growing length.

The loss is the mean squared error of the scaled states over all steps of a window, so that the network learns
to live with its own predictions. What does not depend on the state (drivers, their filters, the hour) passes
the first layer for a whole window at once; only the rest is run step by step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import torch
from scipy.signal import lfilter

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.network import HOURS, Stage, Weights, hour_features
from igrow.trainer.progress import Progress, silent


@dataclass(frozen=True)
class StageLayout:
    """What a stage reads and predicts, before anything is trained; its bounds are those of the registry."""

    name: str
    states: tuple[str, ...]
    drivers: tuple[str, ...]
    time_constants: tuple[float, ...]
    hidden: tuple[int, ...]
    clock: bool = False
    step: float = 1.0
    cumulative: tuple[str, ...] = ("fruit_fresh_weight",)
    """States that can but grow."""


@dataclass(frozen=True)
class TrainingPlan:
    """How a stage is trained; the same plan, data and seed give the same weights on the same machine."""

    updates: tuple[tuple[int, int], ...] = ((4, 4000), (16, 2000), (48, 1000))
    """(steps of the window, number of updates), one phase after the other."""
    batch: int = 256
    learning_rate: float = 3e-3
    """At the start; falls to zero along a half cosine over all updates."""
    decay: float = 0.0
    """Decoupled weight decay (AdamW)."""
    state_noise: float = 0.0
    """Standard deviation, in scaled units, of noise on the state a window starts from."""
    start_share: float = 0.02
    """Share of windows that begin at the first step of a season, where free runs begin."""
    seed: int = 0


@dataclass(frozen=True)
class StageData:
    """Runs of equal length for one stage."""

    drivers: Floats
    """(runs, steps, n); those at index t act over the step from t - 1 to t."""
    states: Floats
    """(runs, steps, s), NaN where unknown."""
    hour: Floats
    """(steps,) hour of the day."""
    valid: Mask
    """(runs, steps); a false one counts neither as target nor as a window's start."""
    weight: Floats = field(default_factory=lambda: np.ones(1))
    """(runs,) or (1,): how often a run is drawn, relative to the others."""
    jumps: Floats | None = None
    """(runs, steps, s) by which a hand moved the states in each step (leaves picked); not learned, but added."""


def filtered(stage: Stage | StageLayout, drivers: Floats) -> Floats:
    """Return the filters (runs, steps, n * k) along runs whose first drivers had stood for ever."""
    parts = []
    for constant in stage.time_constants:
        keep = float(np.exp(-1.0 / constant))
        parts.append(lfilter([1.0 - keep], [1.0, -keep], drivers, axis=1, zi=keep * drivers[:, :1])[0])
    return np.concatenate(parts, axis=-1) if parts else drivers[..., :0]


def raw_features(stage: Stage | StageLayout, drivers: Floats, hour: Floats) -> Floats:
    """Return all inputs but the state, unscaled, (runs, steps, features)."""
    parts = [drivers, filtered(stage, drivers)]
    if stage.clock:
        parts.append(np.broadcast_to(hour_features(np, hour[:, None]), (*drivers.shape[:2], HOURS)))
    return np.concatenate(parts, axis=-1)


def untrained(layout: StageLayout, data: StageData, seed: int) -> Stage:
    """Return a stage with the scales of the data and random weights."""
    generator = np.random.default_rng(seed)
    features = raw_features(layout, data.drivers, data.hour)[data.valid]
    states = data.states[data.valid]
    moved = np.diff(data.states, axis=1) - (0.0 if data.jumps is None else data.jumps[:, 1:])
    increments = moved[data.valid[:, 1:] & data.valid[:, :-1]]
    count, outputs = features.shape[-1] + len(layout.states), len(layout.states)
    matrices: list[Weights] = []
    biases: list[Weights] = []
    for width in (*layout.hidden, outputs):
        scale = np.sqrt(1.0 / count) * (0.3 if len(matrices) == len(layout.hidden) else 1.0)
        matrices.append((generator.standard_normal((count, width)) * scale).astype(np.float32))
        biases.append(np.zeros(width, dtype=np.float32))
        count = width

    def single(values: Floats) -> Weights:
        return values.astype(np.float32)

    # A constant feature must not be blown up: its scale is then its own size, or one.
    spread = features.std(axis=0)
    still = spread < 1e-4 * (np.abs(features).mean(axis=0) + 1e-12)
    return Stage(
        name=layout.name, states=layout.states, drivers=layout.drivers, time_constants=layout.time_constants,
        clock=layout.clock, step=layout.step,
        feature_offset=single(features.mean(axis=0)), feature_scale=single(np.where(still, 1.0, spread)),
        state_offset=single(np.nanmean(states, axis=0)), state_scale=single(np.nanstd(states, axis=0) + 1e-9),
        increment_scale=single(np.nanstd(increments, axis=0) + 1e-9),
        low=single(np.array([QUANTITIES[state].low for state in layout.states])),
        high=single(np.array([QUANTITIES[state].high for state in layout.states])),
        cumulative=tuple(state in layout.cumulative for state in layout.states),
        matrices=tuple(matrices), biases=tuple(biases),
    )  # fmt: skip


class StageModule(torch.nn.Module):
    """The network of a `Stage` in torch; gives what `igrow.core.simulator.network.advance` gives."""

    def __init__(self, stage: Stage) -> None:
        super().__init__()
        self.stage = stage
        self.matrices = torch.nn.ParameterList([torch.tensor(matrix) for matrix in stage.matrices])
        self.biases = torch.nn.ParameterList([torch.tensor(bias) for bias in stage.biases])
        scale = torch.tensor(stage.state_scale)
        self.increment = torch.tensor(stage.increment_scale) / scale
        self.low = (torch.tensor(stage.low) - torch.tensor(stage.state_offset)) / scale
        self.high = (torch.tensor(stage.high) - torch.tensor(stage.state_offset)) / scale
        self.cumulative = torch.tensor(stage.cumulative)

    def scaled_features(self, features: Floats) -> torch.Tensor:
        """Return raw features, (..., f), as the network's first inputs."""
        stage = self.stage
        return torch.tensor(((features - stage.feature_offset) / stage.feature_scale).astype(np.float32))

    def scaled_states(self, states: Floats) -> torch.Tensor:
        """Return states, (..., s), in units of their spread."""
        return torch.tensor(((states - self.stage.state_offset) / self.stage.state_scale).astype(np.float32))

    def forward(self, features: torch.Tensor, state: torch.Tensor, jumps: torch.Tensor | None = None) -> torch.Tensor:
        """Run freely: scaled features (batch, steps, f) and start (batch, s) -> scaled states (batch, steps, s).

        `jumps` (batch, steps, s) are added to the states after their step.
        """
        inner = features.shape[-1]
        prepared = (features @ self.matrices[0][:inner] + self.biases[0]).unbind(1)
        state_matrix = self.matrices[0][inner:]
        outputs = []
        for step, known in enumerate(prepared):
            values = torch.addmm(known, state, state_matrix)
            for matrix, bias in zip(list(self.matrices)[1:], list(self.biases)[1:], strict=True):
                values = torch.addmm(bias, torch.nn.functional.silu(values), matrix)
            if any(self.stage.cumulative):
                values = torch.where(self.cumulative, torch.nn.functional.softplus(values), values)
            state = torch.minimum(torch.maximum(state + self.increment * values, self.low), self.high)
            if jumps is not None:
                state = state + jumps[:, step]
            outputs.append(state)
        return torch.stack(outputs, dim=1)

    def trained_stage(self) -> Stage:
        """Return the stage with the weights as they are now."""
        return replace(
            self.stage,
            matrices=tuple(matrix.detach().numpy().copy() for matrix in self.matrices),
            biases=tuple(bias.detach().numpy().copy() for bias in self.biases),
        )


def train_stage(stage: Stage, data: StageData, plan: TrainingPlan, progress: Progress = silent) -> Stage:
    """Train a stage further on runs of data and return it; the one given is not changed.

    Windows are drawn at random from all runs. Targets that are NaN or not valid do not count; a window starts
    only where the state is known.

    Raises:
        ValueError: no run is as long as a window of the plan.
    """
    generator = np.random.default_rng(plan.seed)
    torch.manual_seed(plan.seed)
    module = StageModule(stage)
    features = module.scaled_features(raw_features(stage, data.drivers, data.hour))
    known = data.valid & np.isfinite(data.states).all(axis=-1)
    counts = torch.tensor((data.valid[..., None] & np.isfinite(data.states)).astype(np.float32))
    states = module.scaled_states(np.nan_to_num(data.states))
    jumps = None if data.jumps is None else torch.tensor((data.jumps / stage.state_scale).astype(np.float32))
    optimizer = torch.optim.AdamW(module.parameters(), plan.learning_rate, weight_decay=plan.decay)
    total = sum(updates for _, updates in plan.updates)
    done = 0
    for window, updates in plan.updates:
        starts = np.argwhere(known[:, :-window])
        if starts.size == 0:
            raise ValueError(f"no run of stage {stage.name} has {window} steps after a known state")
        weight = np.broadcast_to(data.weight, known.shape[0])[starts[:, 0]]
        cumulated = np.cumsum(weight / weight.sum())
        first = starts[starts[:, 1] == 0]
        steps = torch.arange(window + 1)
        losses = []
        for _ in range(updates):
            share = done / total
            for group in optimizer.param_groups:
                group["lr"] = plan.learning_rate * min(1.0, done / 100) * 0.5 * (1 + np.cos(np.pi * share))
            index = np.searchsorted(cumulated, generator.random(plan.batch))
            chosen = starts[np.minimum(index, len(starts) - 1)]
            if len(first):
                begins = generator.random(plan.batch) < plan.start_share
                chosen[begins] = first[generator.integers(len(first), size=int(begins.sum()))]
            run, rows = torch.tensor(chosen[:, :1]), torch.tensor(chosen[:, 1:]) + steps
            start, target, count = states[run[:, 0], rows[:, 0]], states[run, rows[:, 1:]], counts[run, rows[:, 1:]]
            if plan.state_noise:
                start = start + plan.state_noise * torch.randn(start.shape)
            predicted = module(features[run, rows[:, 1:]], start, None if jumps is None else jumps[run, rows[:, 1:]])
            loss = (((predicted - target) ** 2) * count).sum() / count.sum().clamp(min=1.0)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(module.parameters(), 1.0)
            optimizer.step()
            losses.append(loss.item())
            done += 1
        progress(f"{stage.name}: {done} of {total} updates, windows of {window}, loss {np.mean(losses[-50:]):.3g}")
    return module.trained_stage()


def run_stage(stage: Stage, drivers: Floats, hour: Floats, start: Floats) -> Floats:
    """Run one stage freely under known drivers (runs, steps, n) from `start` (runs, s); (runs, steps, s)."""
    module = StageModule(stage)
    with torch.no_grad():
        features = module.scaled_features(raw_features(stage, drivers, hour))
        scaled = module(features[:, 1:], module.scaled_states(start)).numpy().astype(np.float64)
    states = scaled * stage.state_scale + stage.state_offset
    return np.concatenate([start[:, None], states], axis=1)


def run_windows(stage: Stage, data: StageData, starts: Integers, length: int) -> Floats:
    """Run freely for `length` steps from each start (run, step), filters knowing all that went before.

    Returns states (windows, length, s); `starts` is (windows, 2).
    """
    module = StageModule(stage)
    rows = starts[:, 1:] + 1 + np.arange(length)
    with torch.no_grad():
        features = module.scaled_features(raw_features(stage, data.drivers, data.hour))
        begin = module.scaled_states(data.states[starts[:, 0], starts[:, 1]])
        scaled = module(features[starts[:, :1], rows], begin).numpy().astype(np.float64)
    return np.asarray(scaled * stage.state_scale + stage.state_offset)
