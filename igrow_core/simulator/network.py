"""The network variant of the simulator: climate -> growth -> yield, one residual network per stage.

After Cao et al. (2022), iGrow, AAAI 36(11), 11837-11845, with three changes that let a season be run freely
from its first hour: a network gives the increment of its state, so that standing still costs it nothing;
it also sees each driver through first-order filters, which stand for the heat and water that pipes, floor
and crop remember; and what can only grow (the harvest) cannot shrink.

Everything here is pure and written against a namespace `xp` (numpy, torch through an adapter, ndonnx): a day
of it can be unrolled into one ONNX graph. The last axis of every array holds the features, the axes before
it are free (a batch of candidate strategies).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array
from igrow.core.simulator.leaf_picking import LeafPicking

Weights = NDArray[np.float32]

HOURS = 24


@dataclass(frozen=True)
class Stage:
    """One trained stage: what it reads, how that is scaled, and the weights of its network.

    With n drivers, k time constants and s states the network reads n * (1 + k) + (24 if `clock`) + s values.
    """

    name: str
    states: tuple[str, ...]
    """What it predicts, in the units of the registry."""
    drivers: tuple[str, ...]
    """What moves it: values over the step that ends where the predicted state stands."""
    time_constants: tuple[float, ...]
    """Of the first-order filters on every driver, in steps."""
    clock: bool
    """Whether the hour of the day is an input."""
    step: float
    """Length of a step in hours: 1 for climate and growth, 24 for yield."""
    feature_offset: Weights
    feature_scale: Weights
    """A feature enters as (value - offset) / scale; order: drivers, filtered drivers by time constant, hours."""
    state_offset: Weights
    state_scale: Weights
    increment_scale: Weights
    """A network output of 1 moves the state by this much in one step; shape (s,)."""
    low: Weights
    high: Weights
    """No prediction leaves these bounds; shape (s,)."""
    cumulative: tuple[bool, ...]
    """Which states can only grow; their increment is a softplus of the network's output."""
    matrices: tuple[Weights, ...]
    biases: tuple[Weights, ...]
    """Layers in order, each x @ matrix + bias, with SiLU between them."""

    @property
    def memory_size(self) -> int:
        """Number of filter values carried from step to step."""
        return len(self.drivers) * len(self.time_constants)


@dataclass(frozen=True)
class LightFormula:
    """Light above the crop as a linear function of sun and lamps, zero below a threshold (Cao et al. 2022)."""

    radiation: float
    """umol m-2 s-1 per W m-2 of global radiation."""
    lamp: float
    """umol m-2 s-1 at full lamps."""
    constant: float
    threshold: float = 50.0

    def par(self, xp: Any, global_radiation: Array, lamp_on: Array) -> Array:
        """Return light above the crop in umol m-2 s-1."""
        light = self.constant + self.radiation * global_radiation + self.lamp * lamp_on
        return xp.where(light < self.threshold, xp.zeros_like(light), light)


@dataclass(frozen=True)
class NetworkSimulator:
    """The three stages, the light formula and the picking of leaves: all that a free run needs."""

    climate: Stage
    growth: Stage
    harvest: Stage
    light: LightFormula
    picking: LeafPicking | None = None
    """How leaves are picked; None where nobody does."""


def initial_memory(xp: Any, stage: Stage, drivers: Array) -> Array:
    """Return filters that have seen nothing but `drivers` (..., n), shape (..., n * k)."""
    if not stage.time_constants:
        return drivers[..., :0]
    return xp.concat([drivers] * len(stage.time_constants), axis=-1)


def filter_gains(stage: Stage) -> Weights:
    """Return the share of the gap that each filter closes in one step, 1 - exp(-1 / time constant), (n * k,)."""
    gains = [1.0 - np.exp(-1.0 / constant) for constant in stage.time_constants]
    return np.repeat(np.array(gains, dtype=np.float32), len(stage.drivers))


def hour_features(xp: Any, hour: Array) -> Array:
    """Return 24 values (..., 24) for the hour of the day (..., 1): one-hot on full hours, linear between them."""
    gap = xp.abs(hour - np.arange(HOURS, dtype=np.float32))
    gap = xp.minimum(gap, HOURS - gap)
    return xp.maximum(1.0 - gap, xp.zeros_like(gap))


def advance(
    xp: Any, stage: Stage, state: Array, drivers: Array, memory: Array, hour: Array | None = None
) -> tuple[Array, Array]:
    """Run one step of one stage.

    Args:
        state: (..., s) where the step begins.
        drivers: (..., n) over the step, in the units of the registry and the order of `stage.drivers`.
        memory: (..., n * k) filters before the step, see `initial_memory`.
        hour: (..., 1) hour of the day at the step's end, 0 to 24; needed where `stage.clock`.

    Returns:
        At the end of the step.
    """
    if stage.time_constants:
        seen = initial_memory(xp, stage, drivers)
        memory = memory + filter_gains(stage) * (seen - memory)
    parts = [drivers, memory] if stage.time_constants else [drivers]
    if stage.clock:
        parts.append(hour_features(xp, hour))
    features = (xp.concat(parts, axis=-1) - stage.feature_offset) / stage.feature_scale
    inputs = xp.concat([features, (state - stage.state_offset) / stage.state_scale], axis=-1)
    return bounded_step(xp, stage, state, network_output(xp, stage, inputs)), memory


def network_output(xp: Any, stage: Stage, inputs: Array) -> Array:
    """Return the network's last layer (..., s) for scaled inputs; SiLU(z) = z / 2 (1 + tanh(z / 2))."""
    values = inputs
    for index, (matrix, bias) in enumerate(zip(stage.matrices, stage.biases, strict=True)):
        values = xp.tensordot(values, xp.asarray(matrix), axes=1) + bias
        if index < len(stage.matrices) - 1:
            half = 0.5 * values
            values = half * (1.0 + xp.tanh(half))
    return values


def bounded_step(xp: Any, stage: Stage, state: Array, output: Array) -> Array:
    """Return the next state (..., s): the scaled increment added, cumulative states never less, within bounds."""
    if any(stage.cumulative):
        growing = xp.maximum(output, xp.zeros_like(output)) + xp.log(1.0 + xp.exp(-xp.abs(output)))
        mask = np.array(stage.cumulative, dtype=np.float32)
        output = mask * growing + (1.0 - mask) * output
    return xp.minimum(xp.maximum(state + stage.increment_scale * output, stage.low), stage.high)


def stack(columns: Mapping[str, Array], names: tuple[str, ...], axis: int = -1) -> NDArray[np.float32]:
    """Return the named columns as float32 along a new last axis."""
    return np.stack([np.asarray(columns[name], dtype=np.float32) for name in names], axis=axis)
