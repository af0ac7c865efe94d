"""What is known of parameters, with their correlations."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.fit.gaussian import Gaussian

NAMES = ("a", "b", "c")


def known() -> Gaussian:
    scale = np.array([1.0, 1e-5, 300.0])
    correlation = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, -0.3], [0.0, -0.3, 1.0]])
    return Gaussian(NAMES, np.array([1.0, 2e-5, -4.0]), correlation * np.outer(scale, scale))


def test_whitening_makes_it_standard_normal() -> None:
    one = known()
    np.testing.assert_allclose(one.whitening @ one.covariance @ one.whitening.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(one.precision, np.linalg.inv(one.covariance), rtol=1e-6)


def test_a_marginal_keeps_what_is_known_of_some_in_the_order_asked_for() -> None:
    part = known().marginal(("c", "a"))
    assert part.names == ("c", "a")
    assert part.values == {"c": -4.0, "a": 1.0}
    assert part.correlation[0, 1] == 0.0
    assert part.deviations == pytest.approx({"c": 300.0, "a": 1.0})


def test_a_change_of_every_parameter_adds_to_the_variance_and_weakens_correlations() -> None:
    one = known()
    wider = one.widened(one.standard_deviation)
    np.testing.assert_allclose(wider.standard_deviation, np.sqrt(2.0) * one.standard_deviation)
    assert wider.correlation[0, 1] == pytest.approx(0.45)


def test_draws_hang_together_and_keep_within_bounds() -> None:
    one = known()
    free = one.sample(np.random.default_rng(0), 4000, np.full(3, -1e9), np.full(3, 1e9))
    assert np.corrcoef(free["a"][:, 0], free["b"][:, 0])[0, 1] == pytest.approx(0.9, abs=0.02)
    held = one.sample(np.random.default_rng(0), 50, np.array([0.9, -1.0, -10.0]), np.array([1.1, 1.0, 0.0]))
    assert held["a"].shape == (50, 1)
    assert held["a"].min() == 0.9
    assert held["c"].max() == 0.0


def test_independent_parameters_have_no_correlations() -> None:
    one = Gaussian.independent({"x": 1.0, "y": 2.0}, {"y": 0.5, "x": 0.1})
    assert one.names == ("x", "y")
    np.testing.assert_allclose(one.covariance, np.diag([0.01, 0.25]))
