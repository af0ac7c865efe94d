"""The directions in which logs differ are found from logs that each see them in their own way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from igrow.trainer.diagnosis import factors, usual
from igrow.trainer.diagnosis.factors import LogLikelihood

SIZE, ROWS = 12, 40


def design(rng: np.random.Generator) -> NDArray[np.float64]:
    """What a log's rows show of each amplitude: two that look alike, and one that nobody sees."""
    table = rng.normal(size=(ROWS, SIZE))
    table[:, 1] = table[:, 0] + 0.01 * table[:, 1]
    table[:, -1] = 0.0
    return table


def log_of(table: NDArray[np.float64], rows: NDArray[np.float64]) -> LogLikelihood:
    return LogLikelihood(table.T @ table, table.T @ rows)


def drawn(rng: np.random.Generator, loadings: NDArray[np.float64], count: int) -> list[LogLikelihood]:
    logs = []
    for _ in range(count):
        table = design(rng)
        logs.append(log_of(table, table @ loadings @ rng.normal(size=loadings.shape[1]) + rng.normal(size=ROWS)))
    return logs


def test_the_evidence_is_the_marginal_likelihood_of_the_rows() -> None:
    rng = np.random.default_rng(1)
    loadings, table, rows = rng.normal(size=(SIZE, 2)), design(rng), rng.normal(size=ROWS)
    spread = table @ loadings
    whole = multivariate_normal(cov=np.eye(ROWS) + spread @ spread.T).logpdf(rows)
    none = multivariate_normal(cov=np.eye(ROWS)).logpdf(rows)
    assert factors.evidence(loadings, [log_of(table, rows)]) == pytest.approx(float(whole - none), abs=1e-8)


def test_directions_found_explain_unseen_logs_as_well_as_the_true_ones() -> None:
    rng = np.random.default_rng(2)
    true = np.zeros((SIZE, 2))
    true[[2, 3, 4], 0] = (0.8, -0.5, 0.3)
    true[[0, 6], 1] = (0.4, 0.4)
    found = factors.loadings(drawn(rng, true, 60), 2)
    unseen = drawn(rng, true, 60)
    best = factors.evidence(true, unseen)
    assert best > 100.0
    assert factors.evidence(found, unseen) > 0.9 * best
    assert np.all(found[-1] == 0.0)


def test_logs_that_lack_a_candidate_still_tell_of_the_others() -> None:
    rng = np.random.default_rng(3)
    true = np.array([[0.6], [0.0], [-0.6]])
    logs = []
    for number in range(40):
        table = rng.normal(size=(ROWS, 3))
        rows = table @ true @ rng.normal(size=1) + rng.normal(size=ROWS)
        kept = [0, 1, 2] if number % 2 else [0, 2]
        keys = tuple(("lamp_heat", "rain_cooling", "sky_cooling")[one] for one in kept)
        logs.append(usual.Traces(keys, log_of(table[:, kept], rows)))
    (direction,) = usual.directions(logs, 1)
    assert direction["lamp_heat"] * direction["sky_cooling"] < 0.0
    assert abs(direction["lamp_heat"]) == pytest.approx(0.6, abs=0.2)
    assert abs(direction.get("rain_cooling", 0.0)) < 0.1
