"""Calibration on logs whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from virtual_log import SITE, virtual_log

from igrow.core.errors import IgrowError
from igrow.core.simulator.hybrid.disturbance import missing_fluxes
from igrow.core.simulator.hybrid.nominal import nominal, site_record
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.calibration import calibrate, evaluate, prior, split_weeks
from igrow.trainer.calibration.evaluation import starts_within
from igrow.trainer.calibration.forecast import fit_combination
from igrow.trainer.calibration.remainder import fit_remainder
from igrow.trainer.data.splits import alternate_weeks, weeks

TRUTH = {"transmissivity": 1.2, "leakage_wind": 1.3, "transpiration_deficit": 0.75, "assimilation_maximum": 1.25}
"""Factors of the virtual greenhouse's parameters."""


@pytest.fixture(scope="module")
def record() -> Record:
    values = nominal(SITE)
    return site_record(
        virtual_log(16, seed=4, parameters=values | {name: values[name] * by for name, by in TRUTH.items()}),
        SITE,
        300.0,
    )


@pytest.fixture(scope="module")
def fitted(record: Record):
    rows = np.arange(len(record)) < 8 * 288
    return calibrate([(record, rows)], prior(nominal(SITE)), {}, every_hours=24.0, iterations=6)


def test_calibration_lowers_the_error_on_days_it_has_not_seen(record: Record, fitted) -> None:
    later = np.arange(len(record)) >= 9 * 288
    before = evaluate(record, nominal(SITE), {}, ("24_h",), later)
    after = evaluate(record, fitted, {}, ("24_h",), later)
    for quantity in ("air_temperature", "air_humidity", "air_co2"):
        assert after[quantity]["24_h"].mae < 0.5 * before[quantity]["24_h"].mae


def test_the_posterior_is_narrower_than_the_prior_and_holds_the_truth(fitted) -> None:
    known = prior(nominal(SITE))
    assert (fitted.standard_deviation <= 1.001 * known.standard_deviation).all()
    values = nominal(SITE)
    for name, by in TRUTH.items():
        spread = fitted.standard_deviation[fitted.names.index(name)]
        assert abs(fitted.values[name] - by * values[name]) < 4.0 * spread + 0.1 * by * values[name]


def test_draws_of_the_posterior_stay_within_the_bounds(fitted) -> None:
    drawn = fitted.widened(20.0).sample(np.random.default_rng(0), 50)
    assert drawn["screen_air_blocking"].shape == (50, 1)
    assert drawn["screen_air_blocking"].max() <= 0.98


def test_the_true_model_has_no_error_but_noise(record: Record) -> None:
    values = nominal(SITE)
    truth = values | {name: values[name] * by for name, by in TRUTH.items()}
    errors = evaluate(record, truth, {}, ("1_h", "24_h"), np.arange(len(record)) > 2 * 288)
    assert errors["air_temperature"]["24_h"].mae < 0.2
    assert errors["air_temperature"]["24_h"].mae_low <= errors["air_temperature"]["24_h"].mae
    assert errors["air_temperature"]["24_h"].persistence > 0.2


def test_a_log_with_no_whole_day_is_refused_in_one_line(record: Record) -> None:
    with pytest.raises(IgrowError, match="complete enough"):
        calibrate(record.slice(0, 100), prior(nominal(SITE)), {})


def test_the_weeks_of_a_split_never_mix() -> None:
    time = np.datetime64("2020-01-01", "s") + np.arange(60 * 288) * np.timedelta64(300, "s")
    for split in (split_weeks(time, 3, 2), alternate_weeks(time)):
        together = split.fit.astype(int) + split.selection + split.held_out
        assert (together == 1).all()
        for rows in (split.fit, split.selection, split.held_out):
            week = weeks(time)
            assert all(rows[week == number].all() or not rows[week == number].any() for number in np.unique(week))
    with pytest.raises(IgrowError, match="leave none to test"):
        split_weeks(time, 9, 1)


def test_a_run_counts_only_if_all_its_rows_are_allowed(record: Record) -> None:
    allowed = np.zeros(len(record), dtype=bool)
    allowed[500:900] = True
    starts = starts_within(record, allowed, 288, 7)
    assert len(starts) > 3
    assert starts.min() >= 500
    assert (starts + 288).max() < 900


def test_the_remainder_finds_a_flux_that_follows_the_weather_and_stays_bounded() -> None:
    count = 10 * 288
    plain = site_record(virtual_log(10, seed=6), SITE, 300.0)
    lost = -0.15 * plain.inputs["global_radiation"]
    record = site_record(virtual_log(10, seed=6, added={"heat": lost}), SITE, 300.0)
    fit, later = np.arange(count) < 6 * 288, np.arange(count) >= 7 * 288
    values = nominal(SITE)
    remainder = fit_remainder([(record, fit, missing_fluxes(record, values, {}))], 0.03)
    bare = evaluate(record, values, {}, ("24_h",), later)
    added = remainder.fluxes(record)
    helped = evaluate(record, values, {}, ("24_h",), later, added=added)
    assert helped["air_temperature"]["24_h"].mae < 0.6 * bare["air_temperature"]["24_h"].mae
    low, high = remainder.bounds["heat"]
    assert added["heat"].min() >= low
    assert added["heat"].max() <= high


def test_of_two_forecasts_the_better_one_gets_the_weight(record: Record) -> None:
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
