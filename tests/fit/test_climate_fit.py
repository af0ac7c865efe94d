"""The fit of the physical parameters to logs whose truth is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data import prepare_log
from igrow.trainer.fit import climate, solver
from igrow.trainer.fit.climate import bounds, fit_climate, observed_scale, site_prior
from igrow.trainer.fit.evaluation import evaluate
from igrow.trainer.fit.gaussian import Gaussian
from tests.virtual_log import SITE, disturbances, virtual_log

DAYS = 16
STEP = 900.0
PER_DAY = round(86_400.0 / STEP)


def drawn_parameters(seed: int) -> dict[str, float]:
    """A greenhouse as likely as any under the prior, if it keeps off the bounds."""
    known = site_prior(SITE)
    narrow = Gaussian(known.names, known.mean, 0.5 * known.covariance)
    drawn = narrow.sample(np.random.default_rng(seed), 1, *bounds(known.names))
    return {name: float(value[0, 0]) for name, value in drawn.items()}


def record_of(parameters: Mapping[str, float], seed: int = 4, size: float = 1.0) -> Record:
    added = disturbances(DAYS, STEP, seed + 10, size)
    log = virtual_log(DAYS, seed=seed, step=STEP, parameters=parameters, added=added)
    return prepare_log(log, SITE).record()


@pytest.fixture(scope="module")
def truth() -> dict[str, float]:
    return drawn_parameters(3)


@pytest.fixture(scope="module")
def record(truth: dict[str, float]) -> Record:
    return record_of(truth)


@pytest.fixture(scope="module")
def fitted(record: Record) -> Gaussian:
    return fit_climate([(record, np.arange(len(record)) < 10 * PER_DAY)], site_prior(SITE))


def test_the_parameters_of_known_greenhouses_lie_within_the_intervals() -> None:
    """Of what a log tells, 90 % intervals hold about nine of ten, and the errors are as large as the deviations say."""
    known = site_prior(SITE)
    away = []
    for seed in range(3):
        truth = drawn_parameters(seed)
        found = fit_climate([(record_of(truth, seed), None)], known)
        told = found.standard_deviation < 0.5 * known.standard_deviation
        away += list(np.abs((found.mean - [truth[name] for name in found.names]) / found.standard_deviation)[told])
    assert len(away) > 25, "the logs tell many of the parameters"
    assert np.mean(np.array(away) < 1.645) >= 0.8
    assert 0.6 < np.sqrt(np.mean(np.square(away))) < 1.3


def test_the_posterior_is_nowhere_wider_than_the_prior_and_its_parameters_hang_together(fitted: Gaussian) -> None:
    known = site_prior(SITE)
    # Of any combination of parameters no less is known than before.
    assert np.linalg.eigvalsh(known.whitening @ fitted.covariance @ known.whitening.T).max() < 1.001
    assert np.abs(fitted.correlation - np.eye(len(fitted.names))).max() > 0.3


def test_it_lowers_the_error_on_days_it_has_not_seen(truth: dict[str, float]) -> None:
    """Of what could be gained, up to the error of one who knows the parameters, three quarters at least."""
    record = record_of(truth, size=0.1)
    fitted = fit_climate([(record, np.arange(len(record)) < 10 * PER_DAY)], site_prior(SITE))
    later = np.arange(len(record)) >= 11 * PER_DAY
    before, after, least = (
        evaluate(record, values, {}, ("24_h",), later) for values in (nominal(SITE), fitted.values, truth)
    )
    for quantity in ("air_temperature", "air_humidity", "air_co2"):
        was, now, known = (one[quantity]["24_h"].mae for one in (before, after, least))
        assert now - known < 0.25 * (was - known)


def test_no_other_method_finds_a_lower_minimum(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scipy's trust-region reflective method, from another start and to the last digit, on the same rows."""
    seen: dict[str, Any] = {}

    def spied(residuals, jacobian, prior, low, high, **options):
        seen.update(residuals=residuals, jacobian=jacobian, weights=options["weights"], low=low, high=high)
        seen["found"] = solver.solve(residuals, jacobian, prior, low, high, **options)
        return seen["found"]

    monkeypatch.setattr(climate, "solve", spied)
    known = site_prior(SITE)
    fit_climate([(record, np.arange(len(record)) < 4 * PER_DAY)], known)
    root, count = np.sqrt(seen["weights"]), len(known.names)

    def rows(scaled):
        errors = np.where(root > 0.0, seen["residuals"](known.mean + known.standard_deviation * scaled), 0.0)
        return np.append(root * errors, scaled)

    def slopes(scaled):
        slope = seen["jacobian"](known.mean + known.standard_deviation * scaled) * known.standard_deviation
        return np.concatenate([np.where(root > 0.0, slope.T, 0.0).T * root[:, None], np.eye(count)])

    def huber(squares):
        limit = np.append(2.0 * root, np.full(count, 1e9))
        size = np.sqrt(squares) + 1e-300
        far = size > limit
        return np.stack([np.where(far, limit * (2 * size - limit), squares), np.where(far, limit / size, 1), 0 * size])

    low, high = ((seen[side] - known.mean) / known.standard_deviation for side in ("low", "high"))
    begin = np.clip(np.full(count, 0.3), low + 1e-6, high - 1e-6)
    other = least_squares(rows, begin, jac=slopes, bounds=(low, high), loss=huber, ftol=1e-9, xtol=1e-9, gtol=1e-9)
    assert seen["found"].cost <= other.cost + 0.1


def test_two_compartments_are_fitted_as_one(truth: dict[str, float]) -> None:
    known = site_prior(SITE)
    one, other = record_of(truth, seed=4), record_of(truth, seed=9)
    rows = np.arange(len(one)) < 6 * PER_DAY
    both = fit_climate([(one, rows), (other, rows)], known)
    alone = fit_climate([(one, rows)], known)
    assert both.standard_deviation.mean() < alone.standard_deviation.mean()


def test_a_log_with_no_whole_day_is_refused_in_one_line(record: Record) -> None:
    with pytest.raises(IgrowError, match="complete enough"):
        fit_climate([(record.slice(0, 40), None)], site_prior(SITE))


def test_inputs_that_no_greenhouse_has_are_told_as_such(record: Record) -> None:
    wild = replace(record, inputs={**record.inputs, "lamp_power": np.full(len(record), 1e300)})
    with pytest.raises(IgrowError, match="units of the registry"):
        fit_climate([(wild, None)], site_prior(SITE))


def test_white_errors_count_each_and_lasting_ones_once_in_their_time() -> None:
    generator = np.random.default_rng(0)
    white = 1.5 * generator.standard_normal((48, 400))
    spread, worth = observed_scale(white)
    assert spread == pytest.approx(1.5, rel=0.05)
    assert worth > 0.8
    lasting = np.zeros((48, 400))
    for row in range(48):
        before = lasting[row - 1] if row else generator.standard_normal(400)
        lasting[row] = 0.8 * before + 0.6 * generator.standard_normal(400)
    # An autoregressive course is worth (1 - a) / (1 + a) of as many white ones.
    assert observed_scale(lasting)[1] == pytest.approx(0.2 / 1.8, rel=0.35)
