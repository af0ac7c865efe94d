"""Least squares from daily products gives what least squares gives."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.linear import DailyGrams, LinearModel, Term

DAYS, ROWS = 10, 30
RNG = np.random.default_rng(4)
TABLE = RNG.normal(size=(6, 1, DAYS, ROWS))
GRAMS = DailyGrams(linear.daily_products(TABLE, np.arange(DAYS), DAYS), np.arange(DAYS) != 3)
FITTED = TABLE[:, 0, GRAMS.fit].reshape(6, -1)
PRECISION = np.diag([2.0, 0.5])


def exact(columns: np.ndarray, precision: np.ndarray, mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    inverse = np.linalg.inv(columns @ columns.T + precision)
    return inverse @ (-columns @ FITTED[0] + precision @ mean), inverse


def test_coefficients_covariance_and_gain_are_those_of_penalised_least_squares() -> None:
    mean = np.array([0.3, -1.0])
    found = linear.fit(GRAMS, LinearModel((1, 2), PRECISION, mean))
    coefficients, inverse = exact(FITTED[1:3], PRECISION, mean)
    np.testing.assert_allclose(found.solution.coefficients, coefficients, rtol=1e-9)
    np.testing.assert_allclose(found.solution.inverse, inverse, rtol=1e-9)

    def cost(point: np.ndarray) -> float:
        residual, away = FITTED[0] + point @ FITTED[1:3], point - mean
        return 0.5 * float(residual @ residual + away @ PRECISION @ away)

    assert found.solution.gain == pytest.approx(cost(np.zeros(2)) - cost(coefficients), rel=1e-9)


def test_a_term_is_free_and_counts_from_its_day_on() -> None:
    model = LinearModel((1,), PRECISION[:1, :1], np.zeros(1)).with_term(Term(4, onset=6))
    found = linear.fit(GRAMS, model)
    late = np.where(np.repeat(np.flatnonzero(GRAMS.fit) >= 6, ROWS), FITTED[4], 0.0)
    coefficients, inverse = exact(np.stack([FITTED[1], late]), np.diag([2.0, 0.0]), np.zeros(2))
    np.testing.assert_allclose(found.amplitudes, coefficients[1:], rtol=1e-9)
    np.testing.assert_allclose(found.deviations, np.sqrt(inverse[1:, 1]), rtol=1e-9)


def test_an_effect_that_ages_counts_its_days_from_its_beginning() -> None:
    model = LinearModel((), np.zeros((0, 0)), np.zeros(0)).with_term(Term(4, onset=6, ageing=5))
    found = linear.fit(GRAMS, model)
    late = np.where(np.repeat(np.flatnonzero(GRAMS.fit) >= 6, ROWS), FITTED[4] - 6.0 * FITTED[5], 0.0)
    coefficients, _ = exact(late[None], np.zeros((1, 1)), np.zeros(1))
    np.testing.assert_allclose(found.amplitudes, coefficients, rtol=1e-9)


def test_the_loss_of_each_day_adds_up_to_the_sum_of_squares() -> None:
    found = linear.fit(GRAMS, LinearModel((1, 2), PRECISION, np.zeros(2)))
    residual = TABLE[0, 0] + np.tensordot(found.solution.coefficients, TABLE[1:3, 0], axes=1)
    np.testing.assert_allclose(found.day_losses, 0.5 * (residual**2).sum(axis=1), rtol=1e-9)


def test_two_equal_columns_share_a_coefficient_and_do_not_blow_up() -> None:
    twice = TABLE.copy()
    twice[2] = twice[1]
    grams = DailyGrams(linear.daily_products(twice, np.arange(DAYS), DAYS), GRAMS.fit)
    found = linear.fit(grams, LinearModel((1, 2), 1e-9 * np.eye(2), np.zeros(2)))
    assert found.solution.coefficients[0] == pytest.approx(found.solution.coefficients[1], rel=1e-3)
    assert np.abs(found.solution.coefficients).max() < 1.0
