"""The generation of the genetic algorithm from a bundle's optimizer.onnx."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from igrow.core.bundle import open_session
from igrow.core.errors import IgrowError
from igrow.core.planner.evolution import EvolutionSettings, Fitness, Genes, fixed_inputs

OUTPUTS = ("survivors", "survivor_fitness", "next_offspring")
"""Results of the graph, in the order of `evolution.generation`'s."""


class OnnxGeneration:
    """Runs optimizer.onnx; its sizes are read from the graph."""

    def __init__(self, path: Path) -> None:
        """Open the graph; raises IgrowError where it is no optimizer."""
        self._session = open_session(path)
        shapes = {item.name: item.shape for item in self._session.get_inputs()}
        missing = {"parents", "offspring", "tournament"} - shapes.keys()
        if missing:
            raise IgrowError(f"{path}: is no optimizer: it lacks the inputs {', '.join(sorted(missing))}")
        self.settings = EvolutionSettings(
            parents=shapes["parents"][0],
            offspring=shapes["offspring"][0],
            contestants=shapes["tournament"][2],
        )

    def __call__(
        self,
        parents: Genes,
        parent_fitness: Fitness,
        offspring: Genes,
        offspring_fitness: Fitness,
        random: Mapping[str, NDArray[np.float32]],
    ) -> tuple[Genes, Fitness, Genes]:
        """Return survivors, their fitness and the next offspring."""
        inputs = {
            "parents": parents,
            "parent_fitness": parent_fitness,
            "offspring": offspring,
            "offspring_fitness": offspring_fitness,
            **random,
            **fixed_inputs(self.settings, parents.shape[1]),
        }
        survivors, fitness, children = self._session.run(list(OUTPUTS), inputs)
        return survivors, fitness, children
