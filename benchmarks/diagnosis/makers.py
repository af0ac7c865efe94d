"""Whose greenhouses a nursery is of: the project's own plant, or one that shares no balance with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import foreign_greenhouse
from benchmarks.foreign_greenhouse import ForeignGreenhouse
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, HiddenEffect, recipe, simulate_many
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.tomato import Crop, mature_crop, young_crop
from igrow.core.telemetry import Telemetry

Plant = Any
"""Parameters of a greenhouse of a maker's; a frozen dataclass with `varied`, place, lamps, and what `CHANGES` names."""
State = Any
"""What a greenhouse of a maker's begins with."""


@dataclass(frozen=True)
class Batch:
    """Greenhouses that are simulated together."""

    plants: Sequence[Plant]
    weather: Sequence[Telemetry]
    start: np.datetime64
    end: np.datetime64
    states: Sequence[State]
    """At the start."""
    seed: int
    effects: Sequence[Sequence[HiddenEffect]] = ()
    disturbances: Sequence[Disturbances] | None = None


@dataclass(frozen=True)
class Maker:
    """Who simulates the greenhouses of one kind."""

    usual: Callable[[float], Plant]
    """The usual greenhouse at a latitude."""
    begun: Callable[[Sequence[Plant], NDArray[np.bool_]], list[State]]
    """The states at the beginning of a calibration log; the flags say whose crop was just planted."""
    run: Callable[[Batch], list[tuple[Telemetry, State]]]
    """Of every greenhouse the log as its sensors show it, and its state at the end."""


def _own_usual(latitude: float) -> Plant:
    return GreenhouseParameters(latitude=latitude)


def _own_begun(plants: Sequence[Plant], young: NDArray[np.bool_]) -> list[State]:
    both, like = stack(plants), np.zeros(len(plants))
    pairs = zip(young_crop(both, like), mature_crop(both, like), strict=True)
    crops = Crop(*(np.where(young, planted, grown) for planted, grown in pairs))
    return [Crop(*(part[..., one : one + 1] for part in crops)) for one in range(len(plants))]


def _own_run(batch: Batch) -> list[tuple[Telemetry, State]]:
    seasons = simulate_many(
        batch.plants, batch.weather, recipe, batch.start, batch.end, count=len(batch.plants), seed=batch.seed,
        effects=batch.effects, disturbances=batch.disturbances,
        crop=Crop(*(np.concatenate(parts, axis=-1) for parts in zip(*batch.states, strict=True))),
    )  # fmt: skip
    return [(one.measured, one.crop) for one in seasons]


def _foreign_usual(latitude: float) -> Plant:
    return ForeignGreenhouse(latitude=latitude)


def _foreign_begun(plants: Sequence[Plant], young: NDArray[np.bool_]) -> list[State]:
    return [foreign_greenhouse.begun(plant, young=bool(one)) for plant, one in zip(plants, young, strict=True)]


def _foreign_run(batch: Batch) -> list[tuple[Telemetry, State]]:
    return foreign_greenhouse.simulate(
        batch.plants, batch.weather, batch.start, batch.end, batch.states, seed=batch.seed, effects=batch.effects,
        disturbances=batch.disturbances,
    )  # fmt: skip


OWN = Maker(_own_usual, _own_begun, _own_run)
FOREIGN = Maker(_foreign_usual, _foreign_begun, _foreign_run)
