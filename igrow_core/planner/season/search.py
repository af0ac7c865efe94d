"""The search of a season: the best numbers of a strategy by the elitist genetic algorithm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.greenhouse.tomato import Crop
from igrow.core.planner.evolution import WORST, EvolutionSettings, Genes, NumpyGeneration, draw
from igrow.core.planner.optimise import NOT_ADMITTED
from igrow.core.planner.season.course import Season, bearable_damp, run_season
from igrow.core.planner.season.strategy import Strategy

SETTINGS = EvolutionSettings(parents=24, offspring=48)
GENERATIONS = 36
"""Of 48 simulated seasons each; in twice as many the best strategy gained less than one percent."""
NEAR = 0.1
"""Standard deviation of the first candidates about what is known, as part of a gene's range."""
Search = Callable[[Callable[[Genes], Floats], int, int, int, Genes | None], tuple[Genes, list[float]]]


def worth_of(season: Season, strategy: Strategy, crop: Crop) -> Callable[[Genes], Floats]:
    """Return what candidates (B, G) of a strategy are worth in a season from a crop on, EUR m-2, (B,).

    One that chooses the humidity and expects damper days than the crop bears is not admitted (Deb's rule, as in the
    search of a plan).
    """
    most = bearable_damp(season) if "humidity_setpoint" in strategy.optional else np.inf

    def value(genes: Genes) -> Floats:
        outcome = run_season(season, strategy, genes, crop)
        too_damp = np.maximum(outcome.damp.T - most, 0.0).sum(axis=1)
        worth = outcome.balance.net_profit - outcome.penalty
        return np.asarray(np.where(too_damp > 0.0, NOT_ADMITTED * (1.0 + too_damp), worth))

    return value


def genetic(
    value: Callable[[Genes], Floats], genes: int, generations: int, seed: int, first: Genes | None = None
) -> tuple[Genes, list[float]]:
    """Return the best genes (G,) by the elitist genetic algorithm, and the best value after each generation."""
    rng, step = np.random.default_rng(seed), NumpyGeneration(SETTINGS)
    offspring: Genes = rng.random((SETTINGS.offspring, genes), dtype=np.float32)
    if first is not None:
        near = first + NEAR * rng.standard_normal((SETTINGS.offspring // 2, genes))
        offspring[: len(near)] = np.clip(near, 0.0, 1.0)
        offspring[0] = first
    parents, fitness = offspring[: SETTINGS.parents], np.full(SETTINGS.parents, WORST, dtype=np.float32)
    history = []
    for _ in range(generations):
        found = value(offspring).astype(np.float32)
        parents, fitness, offspring = step(parents, fitness, offspring, found, draw(rng, SETTINGS, genes))
        history.append(float(fitness[0]))
    return parents[0], history


def rule_and_strategy(
    season: Season, rule: Strategy, strategy: Strategy, crop: Crop, generations: int, search: Search = genetic
) -> dict[str, tuple[Genes, list[float]]]:
    """Return the best ``rule`` and the best ``season`` by as many simulated seasons each, with their histories.

    A third of the generations goes to a rule that both grow out of.
    """
    third = generations // 3
    rest = generations - third
    short, _ = search(worth_of(season, rule, crop), rule.genes, third, 1, None)
    return {
        "rule": search(worth_of(season, rule, crop), rule.genes, rest, 2, short),
        "season": search(worth_of(season, strategy, crop), strategy.genes, rest, 1, strategy.of_rule(rule, short)),
    }
