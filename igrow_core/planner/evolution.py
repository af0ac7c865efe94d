"""One generation of an elitist genetic algorithm, as a pure function of its random numbers.

The operators are those of Cao et al. (2022), "iGrow: A Smart Agriculture Solution to Autonomous Greenhouse
Control", AAAI 36(11), 11837-11845: tournament selection, two-point crossover with probability 0.3, mutation, and
(mu + lambda) survival, in which the best of parents and offspring together live on. Their genes are integers in
bits; here a gene is a number from 0 to 1, and mutation either draws it anew or moves it by a small step.

Random numbers are inputs, and only comparisons, choices and single float32 operations touch a gene, so that the
function gives the same numbers, bit for bit, in numpy and as an ONNX graph.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Array

Genes = NDArray[np.float32]
Fitness = NDArray[np.float32]

CROSSOVER_PROBABILITY = 0.3
"""Cao et al. (2022)."""
STEP_SHARE = 0.7
"""Part of the mutations that move a gene by a step; the others draw it anew."""
WORST = -3.0e38
"""Fitness of a candidate that could not be valued; finite, so that it can be sorted everywhere."""


@dataclass(frozen=True)
class EvolutionSettings:
    """Sizes and rates of the algorithm; the sizes are fixed in an exported graph.

    A run of the simulator takes little longer for 384 candidates than for 96, so that few large generations find as
    good a plan in three fifths of the time of many small ones.
    """

    parents: int = 48
    """Survivors of a generation (mu)."""
    offspring: int = 384
    """New candidates of a generation (lambda)."""
    contestants: int = 3
    """Candidates in a tournament."""
    mutations: float = 2.0
    """Mean number of genes of a child that mutate."""
    step: float = 0.15
    """Standard deviation of a mutation's step, as part of a gene's range."""


def generation(
    xp: Any,
    parents: Array,
    parent_fitness: Array,
    offspring: Array,
    offspring_fitness: Array,
    tournament: Array,
    crossover: Array,
    mutate: Array,
    fresh: Array,
    step: Array,
    position: Array,
    mutation_rate: Array,
) -> tuple[Array, Array, Array]:
    """Let the best of parents and offspring survive, and breed the next offspring from them.

    Args:
        xp: array namespace (numpy, or one that traces).
        parents: (P, G) genes, 0 to 1.
        parent_fitness: (P,), larger is better; NaN counts as worst.
        offspring: (L, G).
        offspring_fitness: (L,).
        tournament: (L, 2, K) uniform in [0, 1): who meets in the two tournaments of each child.
        crossover: (L, 3) uniform: two cuts, and whether the child is crossed at all.
        mutate: (L, G) uniform: below `mutation_rate` a gene mutates.
        fresh: (L, G) uniform: the gene drawn anew.
        step: (L, G): the step of a gene that moves; NaN where it is drawn anew instead.
        position: (G,): place of each gene, 0 to 1, which the cuts are compared with.
        mutation_rate: () or (1,).

    Returns:
        survivors (P, G) from best to worst, their fitness (P,), and the next offspring (L, G).
    """
    count = parents.shape[0]
    everyone = xp.concat([parents, offspring], axis=0)
    fitness = xp.concat([parent_fitness, offspring_fitness], axis=0)
    fitness = xp.where(xp.isnan(fitness), np.float32(WORST), fitness)
    # A stable order by falling fitness: of equals the elder comes first.
    order = xp.argsort(-fitness, stable=True)[:count]
    survivors = xp.take(everyone, order, axis=0)
    survivor_fitness = xp.take(fitness, order, axis=0)

    # Survivors stand from best to worst, so the winner of a tournament is its smallest index.
    winners = xp.astype(xp.floor(xp.min(tournament, axis=2) * np.float32(count)), xp.int64)
    first = xp.take(survivors, winners[:, 0], axis=0)
    second = xp.take(survivors, winners[:, 1], axis=0)
    low = xp.minimum(crossover[:, 0:1], crossover[:, 1:2])
    high = xp.maximum(crossover[:, 0:1], crossover[:, 1:2])
    crossed = (crossover[:, 2:3] < np.float32(CROSSOVER_PROBABILITY)) & (position >= low) & (position < high)
    child = xp.where(crossed, second, first)
    moved = xp.minimum(xp.maximum(child + step, np.float32(0.0)), np.float32(1.0))
    mutant = xp.where(xp.isnan(step), fresh, moved)
    return survivors, survivor_fitness, xp.where(mutate < mutation_rate, mutant, child)


def draw(rng: np.random.Generator, settings: EvolutionSettings, genes: int) -> Mapping[str, NDArray[np.float32]]:
    """Draw the random numbers of one generation, by the names of `generation`'s arguments."""
    shape = (settings.offspring, genes)
    step = (rng.standard_normal(shape) * settings.step).astype(np.float32)
    step[rng.random(shape) >= STEP_SHARE] = np.nan
    return {
        "tournament": rng.random((settings.offspring, 2, settings.contestants), dtype=np.float32),
        "crossover": rng.random((settings.offspring, 3), dtype=np.float32),
        "mutate": rng.random(shape, dtype=np.float32),
        "fresh": rng.random(shape, dtype=np.float32),
        "step": step,
    }


class Generation(Protocol):
    """Runs `generation`: in numpy, or from optimizer.onnx."""

    @property
    def settings(self) -> EvolutionSettings:
        """The sizes that its arrays have."""

    def __call__(
        self,
        parents: Genes,
        parent_fitness: Fitness,
        offspring: Genes,
        offspring_fitness: Fitness,
        random: Mapping[str, NDArray[np.float32]],
    ) -> tuple[Genes, Fitness, Genes]:
        """Return survivors, their fitness and the next offspring."""


def fixed_inputs(settings: EvolutionSettings, genes: int) -> dict[str, NDArray[np.float32]]:
    """Return the inputs of `generation` that stay the same: place of the genes and mutation rate."""
    return {
        "position": (np.arange(genes, dtype=np.float32) / np.float32(genes)),
        "mutation_rate": np.array([min(0.5, settings.mutations / genes)], dtype=np.float32),
    }


@dataclass(frozen=True)
class NumpyGeneration:
    """The generation in numpy."""

    settings: EvolutionSettings = EvolutionSettings()

    def __call__(
        self,
        parents: Genes,
        parent_fitness: Fitness,
        offspring: Genes,
        offspring_fitness: Fitness,
        random: Mapping[str, NDArray[np.float32]],
    ) -> tuple[Genes, Fitness, Genes]:
        """Return survivors, their fitness and the next offspring."""
        fixed = fixed_inputs(self.settings, parents.shape[1])
        return generation(np, parents, parent_fitness, offspring, offspring_fitness, **random, **fixed)
