"""optimizer.onnx: one generation of the genetic algorithm, traced from the very function that runs in numpy."""

from __future__ import annotations

from typing import Any, cast

import ndonnx as ndx
import onnx

from igrow_core.planner.evolution import EvolutionSettings, generation
from igrow_core.planner.onnx_generation import OUTPUTS


def export_optimizer(settings: EvolutionSettings) -> onnx.ModelProto:
    """Return the graph of `igrow_core.planner.evolution.generation`.

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
