"""optimizer.onnx: one generation of the genetic algorithm, traced from the very function that runs in numpy."""

from __future__ import annotations

from typing import Any, cast

import ndonnx as ndx
import numpy as np
import onnx
from numpy.typing import NDArray

from igrow.core.bundle import GraphSignature, Tensor
from igrow.core.planner.evolution import EvolutionSettings, draw, fixed_inputs, generation
from igrow.core.planner.onnx_generation import OUTPUTS

_GENES = 12
"""Of the self-test."""


def export_optimizer(settings: EvolutionSettings) -> onnx.ModelProto:
    """Return the graph of `igrow.core.planner.evolution.generation`.

    Inputs and outputs have the names of its arguments and results. The numbers of parents, offspring and
    contestants are fixed by `settings`; the number of genes is free, so that one graph serves any horizon.
    """
    parents, offspring = settings.parents, settings.offspring
    shapes: dict[str, tuple[int | str, ...]] = {
        "parents": (parents, "genes"),
        "parent_fitness": (parents,),
        "offspring": (offspring, "genes"),
        "offspring_fitness": (offspring,),
        "tournament": (offspring, 2, settings.contestants),
        "crossover": (offspring, 3),
        "mutate": (offspring, "genes"),
        "fresh": (offspring, "genes"),
        "step": (offspring, "genes"),
        "position": ("genes",),
        "mutation_rate": (1,),
    }
    inputs = {name: ndx.argument(shape=shape, dtype=ndx.float32) for name, shape in shapes.items()}
    results = generation(cast(Any, ndx), **inputs)
    return ndx.build(inputs, dict(zip(OUTPUTS, results, strict=True)))


def optimizer_signature(model: onnx.ModelProto) -> GraphSignature:
    """Return the names of the graph's inputs and outputs; their entries are no quantities."""
    return GraphSignature(
        tuple(Tensor(one.name) for one in model.graph.input), tuple(Tensor(one.name) for one in model.graph.output)
    )


def optimizer_inputs(settings: EvolutionSettings, random: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Return random inputs of the optimizer's graph for the self-test."""

    def population(count: int) -> NDArray[np.float32]:
        return random.random((count, _GENES), dtype=np.float32)

    return {
        "parents": population(settings.parents),
        "parent_fitness": random.random(settings.parents, dtype=np.float32),
        "offspring": population(settings.offspring),
        "offspring_fitness": random.random(settings.offspring, dtype=np.float32),
        **draw(random, settings, _GENES),
        **fixed_inputs(settings, _GENES),
    }
