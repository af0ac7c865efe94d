"""Conversion and maintenance from what growers count, where the answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.simulator.crop import CropStages
from igrow.core.simulator.growth import PRIOR, Count, GrowthDays, fit_growth
from igrow.core.site import Crop

STAGES = CropStages(None, None, 0.60, 2.5e-4)  # type: ignore[arg-type]  # the networks take no part
CROP = Crop()
DAYS = 120


def season(seed: int, days: int = DAYS) -> GrowthDays:
    rng = np.random.default_rng(seed)
    light = 0.02 + 0.015 * np.linspace(0, 1, days) + 0.008 * rng.standard_normal(days)
    warm = 24.0 * np.exp(0.0693 * (rng.uniform(16, 23, days) - 20.0))
    return GrowthDays(np.maximum(light, 0.002), warm)


def grown(days: GrowthDays, conversion: float, maintenance: float) -> np.ndarray:
    return conversion * days.assimilated - maintenance * days.warmth


def weekly(days: GrowthDays, conversion: float, maintenance: float, error: float, seed: int) -> list[Count]:
    rng = np.random.default_rng(seed)
    truth = grown(days, conversion, maintenance)
    return [
        Count(first, first + 7, float(truth[first : first + 7].sum() + error * rng.standard_normal()), error)
        for first in range(0, len(truth) - 7, 7)
    ]


def test_exact_counts_give_the_exact_crop() -> None:
    days = season(0)
    stages, fit = fit_growth(days, weekly(days, 0.5, 6e-4, 1e-6, 1), STAGES, CROP)
    assert stages.conversion == pytest.approx(0.5, rel=1e-3)
    assert stages.maintenance == pytest.approx(6e-4, rel=1e-2)
    assert fit.told == ("conversion", "maintenance")


def test_a_crop_of_less_growth_and_more_maintenance_is_told_by_both() -> None:
    """0.88 of the growth less 7.2 g a day: one factor would take from marginal light what maintenance takes."""
    days = season(3)
    conversion = 0.88 * STAGES.conversion
    maintenance = 0.88 * STAGES.maintenance + 7.2e-3 / 24.0
    stages, _ = fit_growth(days, weekly(days, conversion, maintenance, 5e-3, 4), STAGES, CROP)
    factor = grown(days, conversion, maintenance).sum() / grown(days, STAGES.conversion, STAGES.maintenance).sum()
    assert factor < 0.7
    assert stages.conversion == pytest.approx(conversion, rel=0.1)
    assert abs(stages.conversion - conversion) < 0.4 * abs(factor * STAGES.conversion - conversion)


def test_the_covariance_covers_the_truth() -> None:
    """Over 200 seasons of noisy counts the standardised errors have a spread of one."""
    errors = []
    for seed in range(200):
        days = season(seed)
        rng = np.random.default_rng(1000 + seed)
        truth = np.array([0.60, 2.5e-4]) * (1.0 + np.array(PRIOR) * [0.5, 0.4] * rng.standard_normal(2))
        prior = np.diag((np.array(PRIOR) * [0.5 * 0.60, 0.4 * 2.5e-4]) ** 2)
        stages, fit = fit_growth(days, weekly(days, truth[0], truth[1], 0.01, seed), STAGES, CROP, prior)
        away = np.array([stages.conversion, stages.maintenance]) - truth
        errors.append(away @ np.linalg.solve(fit.covariance, away))
    assert np.mean(errors) == pytest.approx(2.0, abs=0.5)


def test_counts_that_disagree_widen_what_is_known() -> None:
    days = season(5)
    calm = fit_growth(days, weekly(days, 0.55, 3e-4, 5e-3, 6), STAGES, CROP)[1]
    wild = [Count(c.first, c.last, c.amount + (0.05 if k % 2 else -0.05), c.deviation) for k, c in
            enumerate(weekly(days, 0.55, 3e-4, 5e-3, 6))]  # fmt: skip
    loose = fit_growth(days, wild, STAGES, CROP)[1]
    assert loose.misfit > 5.0
    assert np.sqrt(np.diag(loose.covariance)) == pytest.approx(
        np.sqrt(np.diag(loose.covariance)).clip(np.sqrt(np.diag(calm.covariance)) * 1.5)
    )


def test_without_counts_the_prior_stays_and_it_is_said() -> None:
    stages, fit = fit_growth(season(0), [], STAGES, CROP)
    assert (stages.conversion, stages.maintenance) == (STAGES.conversion, STAGES.maintenance)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), np.array(PRIOR) * [0.60, 2.5e-4])
    assert "counts no growth" in fit.sentence
    assert fit.told == ()


def test_harvests_tell_of_the_weeks_in_which_the_fruit_grew() -> None:
    days = season(7)
    truth = grown(days, 0.5, 4e-4) * CROP.fruit_share / CROP.dry_matter_fraction
    ahead = CROP.days_to_harvest
    age = np.arange(DAYS)

    def cumulative(day: int) -> float:
        return float(truth @ np.clip((day - age) / ahead, 0.0, 1.0))

    counts = [
        Count(day, day + 7, cumulative(day + 7) - cumulative(day), 0.02, "picked") for day in range(0, DAYS - 7, 7)
    ]
    stages, fit = fit_growth(days, counts, STAGES, CROP)
    assert fit.counts == sum(count.first >= ahead for count in counts), "fruit that grew before the log tells nothing"
    assert grown(days, stages.conversion, stages.maintenance).sum() == pytest.approx(
        grown(days, 0.5, 4e-4).sum(), rel=0.03
    )
    hanging = [
        Count(count.first, count.last, float(truth[count.first : count.last].sum()), 0.02, "fruit") for count in counts
    ]
    sooner, more = fit_growth(days, hanging, STAGES, CROP)
    assert more.counts == len(counts) > fit.counts
    assert sooner.conversion == pytest.approx(0.5, rel=0.05)


def test_a_day_that_is_not_known_takes_its_week_along() -> None:
    days = season(1)
    days.assimilated[10] = np.nan
    counts = weekly(days, 0.5, 4e-4, 5e-3, 2)
    _, fit = fit_growth(days, counts, STAGES, CROP)
    assert fit.counts == len(counts) - 1


def test_no_crop_lives_by_the_night() -> None:
    days = season(2)
    counts = weekly(days, 0.45, -2e-4, 2e-3, 3)
    stages, _ = fit_growth(days, counts, STAGES, CROP)
    assert stages.maintenance == 0.0
    total = sum(count.amount for count in counts)
    ours = sum(grown(days, stages.conversion, 0.0)[count.first : count.last].sum() for count in counts)
    assert ours == pytest.approx(total, rel=0.05)


def test_draws_keep_the_mean_and_are_the_same_each_time() -> None:
    days = season(4)
    fit = fit_growth(days, weekly(days, 0.5, 4e-4, 0.02, 5), STAGES, CROP)[1]
    draws = fit.draws(5)
    np.testing.assert_array_equal(draws, fit.draws(5))
    np.testing.assert_allclose(draws.mean(axis=0), [fit.conversion, fit.maintenance])
    np.testing.assert_array_equal(draws[0], [fit.conversion, fit.maintenance])
    assert draws[1:, 0].std() > 0.0
