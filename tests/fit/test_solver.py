"""The one solver, on problems whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError, by_differences, covariance, remembered, solve, step

NAMES = ("a", "b", "c")
FAR = np.full(3, 1e9)


def known() -> Gaussian:
    """A prior of parameters that hang together, of very different sizes."""
    scale = np.array([1.0, 1e-4, 50.0])
    correlation = np.array([[1.0, 0.6, -0.2], [0.6, 1.0, 0.1], [-0.2, 0.1, 1.0]])
    return Gaussian(NAMES, np.array([2.0, 3e-4, -20.0]), correlation * np.outer(scale, scale))


def linear(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A design, (n, p), and what was measured, (n,)."""
    generator = np.random.default_rng(seed)
    design = generator.standard_normal((40, 3)) / np.array([1.0, 1e-4, 50.0])
    truth = np.array([2.5, 2e-4, 10.0])
    return design, design @ truth + generator.standard_normal(40)


def test_a_linear_problem_gives_the_exact_posterior() -> None:
    prior, (design, measured) = known(), linear()
    weights = np.linspace(0.1, 2.0, 40)
    found = solve(lambda x: design @ x - measured, lambda _: design, prior, -FAR, FAR, weights=weights)
    precision = (design.T * weights) @ design + np.linalg.inv(prior.covariance)
    right = (design.T * weights) @ measured + np.linalg.solve(prior.covariance, prior.mean)
    np.testing.assert_allclose(found.posterior.covariance, np.linalg.inv(precision), rtol=1e-8)
    np.testing.assert_allclose(found.posterior.mean, np.linalg.solve(precision, right), rtol=1e-8)


def test_without_data_the_posterior_is_the_prior() -> None:
    prior = known()
    nothing = np.zeros((1, 3))
    found = solve(lambda _: np.zeros(1), lambda _: nothing, prior, -FAR, FAR, start=np.array([7.0, 0.0, 0.0]))
    np.testing.assert_allclose(found.posterior.mean, prior.mean, rtol=1e-8)
    np.testing.assert_allclose(found.posterior.covariance, prior.covariance, rtol=1e-8)


def test_two_halves_of_the_data_one_after_the_other_give_what_both_give_at_once() -> None:
    prior, (design, measured) = known(), linear()

    def after(rows: slice, before: Gaussian) -> Gaussian:
        return solve(lambda x: design[rows] @ x - measured[rows], lambda _: design[rows], before, -FAR, FAR).posterior

    once = after(slice(None), prior)
    twice = after(slice(20, 40), after(slice(20), prior))
    np.testing.assert_allclose(twice.mean, once.mean, rtol=1e-7)
    np.testing.assert_allclose(twice.covariance, once.covariance, rtol=1e-7)


def test_rows_of_weight_zero_may_be_missing_and_do_not_count() -> None:
    prior, (design, measured) = known(), linear()
    holes = np.where(np.arange(40) % 4 == 0, np.nan, measured)
    weights = np.isfinite(holes).astype(float)
    with_holes = solve(lambda x: design @ x - holes, lambda _: design, prior, -FAR, FAR, weights=weights)
    rows = np.isfinite(holes)
    without = solve(lambda x: design[rows] @ x - measured[rows], lambda _: design[rows], prior, -FAR, FAR)
    np.testing.assert_allclose(with_holes.posterior.mean, without.posterior.mean, rtol=1e-10)
    np.testing.assert_allclose(with_holes.posterior.covariance, without.posterior.covariance, rtol=1e-10)


def test_a_minimum_beyond_a_bound_lies_on_it_and_the_others_are_fitted_beside() -> None:
    prior, (design, measured) = known(), linear()
    high = np.array([2.1, 1e9, 1e9])
    found = solve(lambda x: design @ x - measured, lambda _: design, prior, -FAR, high)
    assert found.posterior.mean[0] == 2.1
    precision = design.T @ design + prior.precision
    right = design.T @ measured + prior.precision @ prior.mean - precision[:, 0] * 2.1
    np.testing.assert_allclose(found.posterior.mean[1:], np.linalg.solve(precision[1:, 1:], right[1:]), rtol=1e-6)


def test_outliers_pull_a_robust_fit_no_more_than_the_loss_says() -> None:
    """A location: Huber's estimate of known numbers, by its own equation."""
    numbers = np.array([0.1, -0.3, 0.2, 0.4, -0.1, 30.0])
    wide = Gaussian(("a",), np.zeros(1), np.array([[1e8]]))
    found = solve(lambda x: numbers - x, lambda _: -np.ones((6, 1)), wide, FAR[:1] * -1, FAR[:1], robust=2.0)
    place = found.posterior.mean[0]
    assert abs(np.clip(numbers - place, -2.0, 2.0).sum()) < 1e-3
    assert place == pytest.approx(0.46, abs=1e-3)
    weights = np.minimum(1.0, 2.0 / np.abs(numbers - place))
    assert found.posterior.covariance[0, 0] == pytest.approx(1.0 / weights.sum(), rel=1e-4)


def test_a_curved_problem_is_solved_from_afar_by_finite_differences() -> None:
    """Rosenbrock's valley; its minimum is at (1, 1)."""
    prior = Gaussian(("x", "y"), np.array([-1.2, 1.0]), np.eye(2) * 1e6)

    def batch(points: np.ndarray) -> np.ndarray:
        return np.stack([10.0 * (points[:, 1] - points[:, 0] ** 2), 1.0 - points[:, 0]], axis=1)

    narrow = Gaussian(prior.names, prior.mean, np.eye(2) * 1e-8)
    _, jacobian = by_differences(batch, narrow, FAR[:2])
    np.testing.assert_allclose(jacobian(np.array([2.0, 3.0])), [[-40.0, 10.0], [-1.0, 0.0]], atol=1e-3)
    found = solve(lambda point: batch(point[None])[0], jacobian, prior, -FAR[:2], FAR[:2], evaluations=200)
    np.testing.assert_allclose(found.posterior.mean, 1.0, atol=1e-3)


def test_one_step_solves_what_is_linear_within_bounds_and_counts_outliers_as_the_search_does() -> None:
    prior, (design, measured) = known(), linear()
    weights, start = np.linspace(0.1, 2.0, 40), np.array([1.0, 5e-4, 0.0])

    def both(high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = solve(lambda x: design @ x - measured, lambda _: design, prior, -FAR, high, weights=weights)
        return step(design @ start - measured, design, prior, -FAR, high, start, weights=weights), found.posterior.mean

    for high in (FAR, np.array([2.1, 1e9, 1e9])):
        stepped, searched = both(high)
        np.testing.assert_allclose(stepped, searched, rtol=1e-5)
    numbers, wide = np.array([0.1, -0.3, 0.2, 0.4, -0.1, 30.0]), Gaussian(("a",), np.zeros(1), np.array([[1e8]]))
    place = np.array([0.46])
    stays = step(numbers - place, -np.ones((6, 1)), wide, -FAR[:1], FAR[:1], place, robust=2.0)
    assert stays[0] == pytest.approx(0.46, abs=1e-2)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("runaway", [np.nan, np.inf, -1e274, 1e8])
def test_what_runs_out_of_all_bounds_a_little_further_on_stays_in_a_step(runaway: float) -> None:
    prior = Gaussian.independent({"a": 0.0, "b": 0.0}, {"a": 1.0, "b": 1.0})
    slopes = np.stack([np.full(20, runaway), np.ones(20)], axis=1)
    point = step(np.full(20, -3.0), slopes, prior, -FAR[:2], FAR[:2], np.zeros(2))
    np.testing.assert_allclose(point, [0.0, 3.0 * 20 / 21])


def test_a_difference_at_the_upper_bound_goes_inwards() -> None:
    tried: list[np.ndarray] = []

    def batch(points: np.ndarray) -> np.ndarray:
        tried.append(points)
        return points**2

    _, jacobian = by_differences(batch, Gaussian(("a",), np.zeros(1), np.eye(1)), np.ones(1))
    jacobian(np.ones(1))
    assert max(points.max() for points in tried) == 1.0


def test_a_step_on_which_the_model_diverges_is_shortened() -> None:
    def residuals(point: np.ndarray) -> np.ndarray:
        if point[0] > 3.0:
            raise DivergenceError("out of all bounds")
        return np.asarray(100.0 * (np.exp(point) - np.exp(2.9)))

    prior = Gaussian(("a",), np.zeros(1), np.eye(1) * 100.0)
    found = solve(residuals, lambda x: 100.0 * np.exp(x)[:, None], prior, -FAR[:1], FAR[:1])
    assert found.posterior.mean[0] == pytest.approx(2.9, abs=1e-3)


@pytest.mark.filterwarnings("error")
def test_a_step_that_ends_near_the_largest_number_is_shortened_without_a_warning() -> None:
    def residuals(point: np.ndarray) -> np.ndarray:
        return np.where(point > 3.0, 1e200, 100.0 * (np.exp(np.minimum(point, 3.0)) - np.exp(2.9)))

    prior = Gaussian(("a",), np.zeros(1), np.eye(1) * 100.0)
    found = solve(residuals, lambda x: 100.0 * np.exp(x)[:, None], prior, -FAR[:1], FAR[:1])
    assert found.posterior.mean[0] == pytest.approx(2.9, abs=1e-3)


@pytest.mark.parametrize("broken", [lambda x: np.array([np.nan]) * x, lambda x: np.array([np.inf]) + x])
def test_a_model_without_a_finite_error_at_the_start_is_refused(broken) -> None:
    prior = Gaussian(("a",), np.zeros(1), np.eye(1))
    with pytest.raises(DivergenceError, match="where the fit begins"):
        solve(broken, lambda _: np.eye(1), prior, -FAR[:1], FAR[:1])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("runaway", [np.nan, np.inf, 1e274])
def test_a_parameter_whose_difference_diverges_stays_and_the_others_are_fitted(runaway: float) -> None:
    prior = Gaussian.independent({"a": 0.0, "b": 0.0}, {"a": 1.0, "b": 1.0})
    measured = np.linspace(0.0, 3.0, 20)

    def batch(points: np.ndarray) -> np.ndarray:
        a, b = points[:, :1], points[:, 1:]
        return np.where(b > 0.0, runaway, 10.0 * (a * measured - 2.0 * measured))

    residuals, jacobian = by_differences(batch, prior, FAR[:2])
    found = solve(residuals, jacobian, prior, -FAR[:2], FAR[:2])
    assert found.posterior.values["a"] == pytest.approx(2.0, rel=1e-3)
    assert found.posterior.values["b"] == 0.0


def test_the_covariance_by_other_weights_is_that_of_a_fit_with_these() -> None:
    prior, (design, measured) = known(), linear()
    found = solve(lambda x: design @ x - measured, lambda _: design, prior, -FAR, FAR)
    other = covariance(found.residuals, found.jacobian, prior, weights=0.25)
    exact = np.linalg.inv(0.25 * design.T @ design + np.linalg.inv(prior.covariance))
    np.testing.assert_allclose(other, exact, rtol=1e-8)


def test_progress_is_told_of_every_step_with_the_errors_there() -> None:
    prior, (design, measured) = known(), linear()
    told: list[tuple[int, float]] = []
    found = solve(
        lambda x: design @ x - measured, lambda _: design, prior, -FAR, FAR,
        progress=lambda number, errors: told.append((number, float(np.sum(errors**2)))),
    )  # fmt: skip
    assert [number for number, _ in told] == list(range(len(told)))
    assert told[-1][1] == pytest.approx(float(np.sum(found.residuals**2)))
    assert told[-1][1] < told[0][1]


def test_a_model_is_run_once_for_errors_and_slopes_at_a_point() -> None:
    asked: list[list[float]] = []

    def model(point: np.ndarray) -> np.ndarray:
        asked.append(point.tolist())
        return 2.0 * point

    once = remembered(model)
    for point in ([1.0, 2.0], [1.0, 2.0], [3.0, 2.0], [3.0, 2.0], [1.0, 2.0]):
        assert once(np.array(point)).tolist() == (2.0 * np.array(point)).tolist()
    assert asked == [[1.0, 2.0], [3.0, 2.0], [1.0, 2.0]]
