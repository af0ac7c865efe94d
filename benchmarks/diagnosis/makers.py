"""Whose greenhouses a nursery is of: the project's own plant, or one that shares no equation with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks import foreign_greenhouse
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, HiddenEffect, recipe, simulate_many
from igrow.core.greenhouse.parameters import stack
from igrow.core.greenhouse.tomato import Crop, mature_crop, young_crop
from igrow.core.telemetry import Telemetry

Plant = Any
"""Parameters of a greenhouse of a maker's; a frozen dataclass with `varied`, place, lamps, and what `CHANGES` names."""
State = Any
"""What a greenhouse of a maker's begins with."""


class Maker(Protocol):
    """Who simulates the greenhouses of one kind."""

    def usual(self, latitude: float) -> Plant:
        """Return the usual greenhouse at a latitude."""

    def begun(self, plants: Sequence[Plant], young: NDArray[np.bool_]) -> list[State]:
        """Return the states at the beginning of a calibration log; `young` says whose crop was just planted."""

    def run(
        self,
        plants: Sequence[Plant],
        weather: Sequence[Telemetry],
        start: np.datetime64,
        end: np.datetime64,
        states: Sequence[State],
        *,
        seed: int,
        effects: Sequence[Sequence[HiddenEffect]] = (),
        disturbances: Sequence[Disturbances] | None = None,
    ) -> list[tuple[Telemetry, State]]:
        """Simulate a batch: of every greenhouse the log as its sensors show it, and its state at the end."""


@dataclass(frozen=True)
class OwnPlant:
    """The project's mechanistic greenhouse."""

    def usual(self, latitude: float) -> Plant:
        return GreenhouseParameters(latitude=latitude)

    def begun(self, plants: Sequence[Plant], young: NDArray[np.bool_]) -> list[State]:
        both, like = stack(plants), np.zeros(len(plants))
        pairs = zip(young_crop(both, like), mature_crop(both, like), strict=True)
        crops = Crop(*(np.where(young, planted, grown) for planted, grown in pairs))
        return [Crop(*(part[..., one : one + 1] for part in crops)) for one in range(len(plants))]

    def run(
        self,
        plants: Sequence[Plant],
        weather: Sequence[Telemetry],
        start: np.datetime64,
        end: np.datetime64,
        states: Sequence[State],
        *,
        seed: int,
        effects: Sequence[Sequence[HiddenEffect]] = (),
        disturbances: Sequence[Disturbances] | None = None,
    ) -> list[tuple[Telemetry, State]]:
        crop = Crop(*(np.concatenate(parts, axis=-1) for parts in zip(*states, strict=True)))
        seasons = simulate_many(
            plants, weather, recipe, start, end, count=len(plants), seed=seed, effects=effects,
            disturbances=disturbances, crop=crop,
        )  # fmt: skip
        return [(one.measured, one.crop) for one in seasons]


@dataclass(frozen=True)
class ForeignPlant:
    """`foreign_greenhouse`."""

    def usual(self, latitude: float) -> Plant:
        return foreign_greenhouse.ForeignGreenhouse(latitude=latitude)

    def begun(self, plants: Sequence[Plant], young: NDArray[np.bool_]) -> list[State]:
        return [foreign_greenhouse.begun(plant, young=bool(one)) for plant, one in zip(plants, young, strict=True)]

    def run(
        self,
        plants: Sequence[Plant],
        weather: Sequence[Telemetry],
        start: np.datetime64,
        end: np.datetime64,
        states: Sequence[State],
        *,
        seed: int,
        effects: Sequence[Sequence[HiddenEffect]] = (),
        disturbances: Sequence[Disturbances] | None = None,
    ) -> list[tuple[Telemetry, State]]:
        return foreign_greenhouse.simulate(
            plants, weather, start, end, states, seed=seed, effects=effects, disturbances=disturbances
        )


OWN, FOREIGN = OwnPlant(), ForeignPlant()
