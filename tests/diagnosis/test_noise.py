"""The colour of disturbances is found, and taken out of errors and sensitivities alike."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from igrow.core.arrays import Floats
from igrow.trainer.diagnosis.design import noise
from igrow.trainer.diagnosis.design.noise import FREEDOM

RUNS, STEPS = 60, 96
COUNTED = np.ones((RUNS, STEPS), dtype=bool)


def coloured(pole: float, seed: int, size: float = 1.0) -> Floats:
    white = student(FREEDOM).rvs(size=(RUNS, STEPS), random_state=np.random.default_rng(seed))
    filtered: Floats = size * lfilter([1.0], [1.0, -pole], white)
    return filtered


def test_an_autoregressive_disturbance_becomes_white_of_known_scale() -> None:
    errors = coloured(0.8, 1, size=0.3)[None]
    whitening = noise.fit_noise(errors, COUNTED, COUNTED[:, :1])
    innovations = whitening.filters[0](errors[0])
    lagged = float(np.mean(innovations[:, 1:] * innovations[:, :-1]) / np.mean(innovations**2))
    assert abs(lagged) < 0.05
    # The scale of Student's t is that of the draws.
    assert 1.0 / whitening.root[0, 0] == pytest.approx(0.3, rel=0.05)


def test_the_filter_has_the_response_of_the_disturbances_inverse() -> None:
    found = noise.fit_filter(coloured(0.8, 2), COUNTED)
    impulse = np.zeros((1, 12))
    impulse[0, 0] = 1.0
    np.testing.assert_allclose(found(impulse)[0], [1.0, -0.8, *[0.0] * 10], atol=0.1)


def test_white_errors_are_left_nearly_as_they_are() -> None:
    found = noise.fit_filter(coloured(0.0, 3), COUNTED)
    impulse = np.zeros((1, 6))
    impulse[0, 0] = 1.0
    np.testing.assert_allclose(found(impulse)[0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=0.06)


def test_balances_that_go_together_become_independent() -> None:
    first, own = coloured(0.0, 4), coloured(0.0, 5)
    errors = np.stack([first, 0.8 * first + 0.6 * own])
    white = noise.fit_noise(errors, COUNTED, COUNTED[:, :1])(errors[None])[0]
    assert abs(float(np.corrcoef(white.reshape(2, -1))[0, 1])) < 0.05


def test_a_sample_far_out_counts_little_and_one_that_is_not_observed_not_at_all() -> None:
    errors = coloured(0.0, 6)[None].copy()
    errors[0, 0, 0] = 50.0
    observed = COUNTED.copy()
    observed[1] = False
    weight = noise.fit_noise(errors, observed, COUNTED[:, :1]).weight
    assert weight[0, 0] < 0.1
    assert (weight[1] == 0.0).all()
    assert weight.max() == pytest.approx(np.sqrt((FREEDOM + 1.0) / FREEDOM), rel=0.01)


def test_the_slopes_of_a_fit_are_those_of_its_deviance() -> None:
    errors, raw, small = coloured(0.8, 7)[:5], np.array([2.0, 4.0, 0.5, 1.5, 3.0]), 1e-6
    errors[0, 0] = 0.0
    innovation = noise._filtered(errors, raw)
    slopes = [noise._deviance_slope(innovation) * one for one in noise._filter_slopes(innovation, raw)]
    for change, slope in zip(small * np.eye(len(raw)), slopes, strict=True):
        above, below = (noise._deviance(noise._filtered(errors, raw + sign * change)) for sign in (1.0, -1.0))
        np.testing.assert_allclose(slope, (above - below) / (2.0 * small), atol=1e-6)
