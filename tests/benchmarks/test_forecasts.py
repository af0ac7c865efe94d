"""What no bundle carries: the residual model, and combinations of runs."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.forecasts.combination import fit_combination
from benchmarks.forecasts.disturbance import missing_fluxes, observed_runs
from benchmarks.forecasts.residual_model import fit_residual_model
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.trainer.fit.evaluation import errors_of, evaluate, summarise
from tests.virtual_log import GREENHOUSE, SITE, virtual_log


def test_the_remainder_finds_a_flux_that_follows_the_weather_and_stays_bounded() -> None:
    count = 10 * 288
    plain = site_record(virtual_log(10, seed=6), SITE, 300.0)
    lost = -0.15 * plain.inputs["global_radiation"]
    record = site_record(virtual_log(10, seed=6, added={"heat": lost}), SITE, 300.0)
    fit, later = np.arange(count) < 6 * 288, np.arange(count) >= 7 * 288
    values = GREENHOUSE
    residual_model = fit_residual_model([(record, fit, missing_fluxes(record, values, {}))], 0.03)
    bare = evaluate(record, values, {}, ("24_h",), later)
    added = residual_model.fluxes(record)
    runs = observed_runs(record, values, {}, added)
    helped = summarise([errors_of(record, runs, ("24_h",), later)])
    assert helped["air_temperature"]["24_h"].mae < 0.6 * bare["air_temperature"]["24_h"].mae
    low, high = residual_model.bounds["heat"]
    assert added["heat"].min() >= low
    assert added["heat"].max() <= high


@pytest.mark.slow
def test_of_two_forecasts_the_better_one_gets_the_weight() -> None:
    record = site_record(virtual_log(16, seed=4), SITE, 300.0)
    generator = np.random.default_rng(0)
    starts = np.arange(3 * 288, 10 * 288, 97)

    def spoiled(size: float):
        def predict(begin, steps):
            rows = begin + 1 + np.arange(steps)[:, None]
            return {
                name: values[rows] + size * generator.standard_normal(rows.shape)
                for name, values in record.measured.items()
            }

        return predict

    found = fit_combination(record, spoiled(3.0), spoiled(0.3), starts, 100)
    assert found["air_temperature"].setpoints_weight.min() > 0.9
    assert found["air_temperature"].setpoints_share.max() < 0.2
