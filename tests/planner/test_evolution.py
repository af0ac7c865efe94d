"""One generation: who survives, what children are made of, and that the ONNX graph says the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.core.errors import IgrowError
from igrow.core.planner.evolution import WORST, EvolutionSettings, Fitness, Genes, NumpyGeneration, draw
from igrow.core.planner.onnx_generation import OnnxGeneration

Population = tuple[Genes, Fitness, Genes, Fitness]
SMALL = EvolutionSettings(parents=6, offspring=10, contestants=2)


def population(rng: np.random.Generator, genes: int, sizes: EvolutionSettings = SMALL) -> Population:
    return (
        rng.random((sizes.parents, genes), dtype=np.float32),
        rng.standard_normal(sizes.parents).astype(np.float32),
        rng.random((sizes.offspring, genes), dtype=np.float32),
        rng.standard_normal(sizes.offspring).astype(np.float32),
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 20))
def test_the_best_of_parents_and_offspring_survive_in_order(seed: int, genes: int) -> None:
    rng = np.random.default_rng(seed)
    parents, parent_fitness, offspring, offspring_fitness = population(rng, genes)
    run = NumpyGeneration(SMALL)
    survivors, fitness, children = run(parents, parent_fitness, offspring, offspring_fitness, draw(rng, SMALL, genes))
    everyone = np.concatenate([parent_fitness, offspring_fitness])
    np.testing.assert_array_equal(fitness, np.sort(everyone)[::-1][:6])
    np.testing.assert_array_equal(survivors[0], np.concatenate([parents, offspring])[np.argmax(everyone)])
    assert children.shape == (10, genes)
    assert children.min() >= 0.0
    assert children.max() <= 1.0


def test_a_candidate_that_cannot_be_valued_never_survives_a_valued_one() -> None:
    rng = np.random.default_rng(1)
    parents, parent_fitness, offspring, offspring_fitness = population(rng, 4)
    parent_fitness[0] = np.nan
    offspring_fitness[0] = np.nan
    _, fitness, _ = NumpyGeneration(SMALL)(parents, parent_fitness, offspring, offspring_fitness, draw(rng, SMALL, 4))
    assert np.isfinite(fitness).all()
    assert fitness.min() > WORST


def test_without_mutation_each_child_is_a_stretch_of_one_parent_within_another() -> None:
    rng = np.random.default_rng(2)
    genes = 12
    parents, parent_fitness, offspring, offspring_fitness = population(rng, genes)
    random = {**draw(rng, SMALL, genes), "mutate": np.ones((10, genes), dtype=np.float32)}
    random["crossover"][:, 2] = 0.0
    survivors, _, children = NumpyGeneration(SMALL)(parents, parent_fitness, offspring, offspring_fitness, random)
    for child in children:
        origin = np.array([np.flatnonzero(np.isclose(survivors[:, g], child[g]))[0] for g in range(genes)])
        assert len(np.unique(origin)) <= 2
        assert np.count_nonzero(np.diff(origin)) <= 2


def test_children_are_crossed_in_three_of_ten_cases() -> None:
    sizes = EvolutionSettings(parents=50, offspring=4000, contestants=1)
    rng = np.random.default_rng(3)
    parents, parent_fitness, offspring, offspring_fitness = population(rng, 40, sizes)
    random = draw(rng, sizes, 40)
    random["mutate"][:] = 1.0
    survivors, _, children = NumpyGeneration(sizes)(parents, parent_fitness, offspring, offspring_fitness, random)
    whole = (children[:, None, :] == survivors[None]).all(axis=2).any(axis=1)
    # Of the crossed, 2 % have the same two parents and 5 % a stretch that holds no gene.
    assert 1 - whole.mean() == pytest.approx(0.28, abs=0.025)


def test_better_candidates_have_more_children() -> None:
    sizes = EvolutionSettings(parents=10, offspring=2000, contestants=3)
    rng = np.random.default_rng(4)
    parents, parent_fitness, offspring, offspring_fitness = population(rng, 5, sizes)
    random = draw(rng, sizes, 5)
    random["mutate"][:] = 1.0
    random["crossover"][:, 2] = 1.0
    survivors, _, children = NumpyGeneration(sizes)(parents, parent_fitness, offspring, offspring_fitness, random)
    shares = (children[:, None, :] == survivors[None]).all(axis=2).mean(axis=0)
    # The best of ten wins a tournament of three unless it is never drawn.
    assert shares[0] == pytest.approx(1 - 0.9**3, abs=0.04)
    assert (np.diff(shares[:8]) < 0).all()


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from igrow.trainer.exporting.optimizer import export_optimizer

    path = tmp_path_factory.mktemp("optimizer") / "optimizer.onnx"
    model = export_optimizer(EvolutionSettings())
    assert len(model.graph.node) < 300
    path.write_bytes(model.SerializeToString())
    return path


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), genes=st.integers(1, 100), ties=st.booleans())
def test_the_graph_breeds_the_same_generations_bit_for_bit(graph: Path, seed: int, genes: int, ties: bool) -> None:
    rng = np.random.default_rng(seed)
    onnx, plain = OnnxGeneration(graph), NumpyGeneration()
    assert onnx.settings == plain.settings
    current = population(rng, genes, plain.settings)
    if ties:
        current = (current[0], np.round(current[1]), current[2], np.round(current[3]))
        current[3][:5] = np.nan
    for _ in range(3):
        random = draw(rng, plain.settings, genes)
        ours, theirs = plain(*current, random), onnx(*current, random)
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype == np.float32
        current = (ours[0], ours[1], ours[2], rng.standard_normal(len(ours[2])).astype(np.float32))


def test_a_file_that_is_no_optimizer_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"nothing")
    with pytest.raises(IgrowError, match="onnxruntime cannot load the graph"):
        OnnxGeneration(tmp_path / "a.onnx")
