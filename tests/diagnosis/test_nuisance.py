"""What greenhouses show though nothing is missing is learned from logs that each see it in their own way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from benchmarks.diagnosis import factor_analysis
from benchmarks.diagnosis.factor_analysis import LogLikelihood
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis import linear, nuisance
from igrow.trainer.diagnosis.nuisance import read_nuisance
from igrow.trainer.diagnosis.rules import DEFAULT
from tests.diagnosis.synthetic_design import Truth, make_design

SIZE, ROWS = 12, 40
KEYS = tuple(f"k{number:02d}" for number in range(SIZE))


def table_of(rng: np.random.Generator) -> NDArray[np.float64]:
    """What a log's rows show of each amplitude: two that look alike, and one that nobody sees."""
    table = rng.normal(size=(ROWS, SIZE))
    table[:, 1] = table[:, 0] + 0.01 * table[:, 1]
    table[:, -1] = 0.0
    return table


def log_of(table: NDArray[np.float64], rows: NDArray[np.float64], keys: tuple[str, ...] = KEYS) -> LogLikelihood:
    return LogLikelihood(keys, table.T @ table, table.T @ rows)


def drawn(rng: np.random.Generator, loadings: NDArray[np.float64], count: int) -> list[LogLikelihood]:
    logs = []
    for _ in range(count):
        table = table_of(rng)
        logs.append(log_of(table, table @ loadings @ rng.normal(size=loadings.shape[1]) + rng.normal(size=ROWS)))
    return logs


def directions_of(loadings: NDArray[np.float64]) -> list[dict[str, float]]:
    return [dict(zip(KEYS, axis.tolist(), strict=True)) for axis in loadings.T]


def test_the_evidence_is_the_marginal_likelihood_of_the_rows() -> None:
    rng = np.random.default_rng(1)
    loadings, table, rows = rng.normal(size=(SIZE, 2)), table_of(rng), rng.normal(size=ROWS)
    spread = table @ loadings
    whole = multivariate_normal(cov=np.eye(ROWS) + spread @ spread.T).logpdf(rows)
    none = multivariate_normal(cov=np.eye(ROWS)).logpdf(rows)
    found = factor_analysis.evidence(directions_of(loadings), [log_of(table, rows)])
    assert found == pytest.approx(float(whole - none), abs=1e-8)


def test_directions_found_explain_unseen_logs_as_well_as_the_true_ones() -> None:
    rng = np.random.default_rng(2)
    true = np.zeros((SIZE, 2))
    true[[2, 3, 4], 0] = (0.8, -0.5, 0.3)
    true[[0, 6], 1] = (0.4, 0.4)
    found = factor_analysis.learn_directions(drawn(rng, true, 60), 2)
    unseen = drawn(rng, true, 60)
    best = factor_analysis.evidence(directions_of(true), unseen)
    assert best > 100.0
    assert factor_analysis.evidence(found, unseen) > 0.9 * best
    # What nobody sees is in no direction.
    assert all(KEYS[-1] not in one for one in found)


def test_logs_that_lack_a_candidate_still_tell_of_the_others() -> None:
    rng = np.random.default_rng(3)
    true = np.array([[0.6], [0.0], [-0.6]])
    logs = []
    for number in range(40):
        table = rng.normal(size=(ROWS, 3))
        rows = table @ true @ rng.normal(size=1) + rng.normal(size=ROWS)
        kept = [0, 1, 2] if number % 2 else [0, 2]
        keys = tuple(("lamp_heat", "rain_cooling", "sky_cooling")[one] for one in kept)
        logs.append(log_of(table[:, kept], rows, keys))
    (direction,) = factor_analysis.learn_directions(logs, 1)
    assert direction["lamp_heat"] * direction["sky_cooling"] < 0.0
    assert abs(direction["lamp_heat"]) == pytest.approx(0.6, abs=0.2)
    assert abs(direction.get("rain_cooling", 0.0)) < 0.1


def test_what_a_log_says_is_its_likelihood_with_the_null_integrated_out() -> None:
    design = make_design(Truth({"lamp_heat": 0.2}, {}, (0.3, -0.2)), parameters=2)
    told = factor_analysis.marginal(design)
    assert told.keys == ("lamp_heat", "rain_cooling", "heat:cold weather")
    rows = design.values.reshape(len(design.values), -1)
    base, others = rows[design.columns("parameter")], rows[[*design.columns("effect"), *design.columns("pattern")]]
    precision = np.linalg.inv(np.eye(rows.shape[1]) + base.T @ base)
    np.testing.assert_allclose(told.information, others @ precision @ others.T, rtol=1e-8)
    np.testing.assert_allclose(told.score, -others @ precision @ rows[0], rtol=1e-8)


def test_the_discrepancy_of_a_calibration_is_a_ridge_regression_on_all_candidates() -> None:
    design = make_design(Truth({"lamp_heat": 0.2}, {"heat:cold weather": 0.1}), parameters=2)
    line = replace(design.line, parameters={"p0": 0.5, "p1": 0.0})
    found = nuisance.learn_discrepancy(replace(design, line=line))
    columns = [*design.columns("effect"), *design.columns("pattern")]
    rows = design.values.reshape(len(design.values), -1)
    scale = np.array([0.7 * EFFECTS[name].amplitude.typical for name in ("lamp_heat", "rain_cooling")] + [0.15])
    exact = np.linalg.solve(rows[columns] @ rows[columns].T + np.diag(scale**-2.0), -rows[columns] @ rows[0])
    assert [found[key] for key in ("lamp_heat", "rain_cooling", "heat:cold weather")] == pytest.approx(exact.tolist())
    assert (found["parameter:p0"], found["parameter:p1"]) == (0.5, 0.0)


def test_the_usual_amplitude_of_what_is_there_is_its_square_less_its_variance() -> None:
    design = make_design(Truth({"lamp_heat": 0.3}, {}))
    found = factor_analysis.null_amplitudes(design)
    (column,) = design.columns("effect:lamp_heat")
    joint = linear.fit(design.grams, design.null_model().with_term(linear.Term(column)))
    assert found["lamp_heat"] == pytest.approx(joint.amplitudes[0] ** 2 - joint.deviations[0] ** 2, rel=0.05)


def test_the_usual_amplitude_of_many_logs_is_the_root_mean_square_over_all() -> None:
    logs = [{"lamp_heat": 0.04}, {"lamp_heat": 0.0, "rain_cooling": 4.0}, {}, {"lamp_heat": 0.04}]
    assert factor_analysis.root_mean_squares(logs) == {
        "lamp_heat": pytest.approx(0.1414, abs=1e-3),
        "rain_cooling": 1.0,
    }


def test_the_stored_subspace_says_where_it_comes_from() -> None:
    known = read_nuisance()
    assert {"command", "seeds"} <= set(known.provenance)
    assert len(known.directions(transferred=False)) == DEFAULT.nuisance_directions
    assert len(known.directions(transferred=True)) == DEFAULT.nuisance_directions_transferred


def test_only_a_long_log_is_asked_for_more_than_seasons_usually_show() -> None:
    known = read_nuisance()
    assert known.null_amplitude(29, DEFAULT) == {}
    assert set(known.null_amplitude(85, DEFAULT)) <= set(EFFECTS)
    assert known.null_amplitude(85, DEFAULT)["structure_shade"] > 0.0
