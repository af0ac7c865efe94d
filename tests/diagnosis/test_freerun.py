"""Free runs: parameters that come back, and scores of runs whose errors are known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.core.simulator.hybrid.nominal import nominal
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis.design import freerun, sensitivity
from igrow.trainer.diagnosis.design.freerun import FreeRuns, LogDays, Refittable, Stage
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.search.omission import fit_together
from igrow.trainer.fit import Gaussian
from tests.virtual_log import SITE, virtual_log


def runs(errors: list[list[float]], shown: float = 0.0, days: tuple[int, ...] = (3, 4)) -> FreeRuns:
    table = np.array(errors)
    return FreeRuns({"air_temperature": np.full(table.shape, shown)}, {"air_temperature": table}, np.array(days))


def test_skill_is_the_share_of_the_squared_error_that_falls_mean_over_days() -> None:
    before = runs([[2.0, 2.0], [2.0, 2.0]])
    # Nothing is left on the first day, all of it on the second.
    assert freerun.skill(before, runs([[0.0, 2.0], [0.0, 2.0]])) == pytest.approx(0.5)
    assert freerun.skill(before, before) == 0.0
    assert freerun.skill(before, runs([[2.0, 4.0], [2.0, 4.0]])) == pytest.approx(-1.5)


def test_a_run_that_leaves_all_bounds_has_no_skill_and_says_nothing() -> None:
    before, lost = runs([[2.0, 2.0], [2.0, 2.0]]), runs([[1e200, 1e200], [2.0, 2.0]])
    with np.errstate(over="raise"):
        assert freerun.skill(before, lost) == -np.inf
        assert freerun.root_mean_square(lost.errors["air_temperature"]) == np.inf


def test_what_was_not_measured_does_not_count() -> None:
    nan = float("nan")
    assert freerun.skill(runs([[2.0, nan], [2.0, 2.0]]), runs([[1.0, nan], [1.0, 2.0]])) == pytest.approx(0.375)
    assert freerun.mean_absolute_errors(runs([[1.0, -3.0], [nan, 2.0]])) == {"air_temperature": pytest.approx(2.0)}
    assert freerun.mean_absolute_errors(runs([[nan, nan]])) == {}
    assert freerun.mean_absolute_errors(None) == {}


def test_the_size_of_an_effect_is_what_it_moves_over_what_stays() -> None:
    corrected = runs([[0.5, -0.5], [0.5, -0.5]], shown=20.0)
    assert freerun.effect_to_noise(runs([[1.0, 1.0], [1.0, 1.0]], shown=21.0), corrected) == pytest.approx(2.0)


@pytest.fixture(scope="module")
def moved() -> tuple[dict[str, float], Gaussian]:
    """Parameters of a greenhouse that has changed, and the fit to its log from what was known before."""
    known = nominal(SITE)
    truth = known | {"leakage_wind": 1.5 * known["leakage_wind"], "transmissivity": 0.9 * known["transmissivity"]}
    record = prepare_log(virtual_log(16, seed=8, step=900.0, parameters=truth), SITE).record(0.0)
    split = split_days(record, SITE.longitude)
    prior = Gaussian.independent(known, {name: 0.6 * abs(value) + 1e-9 for name, value in known.items()})
    days = LogDays(record, split, sensitivity.day_runs(record, split.day))
    return truth, days.fit(prior, ())


def test_parameters_that_moved_are_found_within_their_intervals(moved: tuple[dict[str, float], Gaussian]) -> None:
    truth, found = moved
    for name in ("leakage_wind", "transmissivity"):
        assert abs(found.values[name] - truth[name]) < 2.0 * found.deviations[name]
    assert found.values["leakage_wind"] == pytest.approx(truth["leakage_wind"], rel=0.1)
    assert found.values["transmissivity"] == pytest.approx(truth["transmissivity"], rel=0.05)


def test_the_posterior_tells_how_parameters_hang_together(moved: tuple[dict[str, float], Gaussian]) -> None:
    _, found = moved
    np.testing.assert_allclose(found.covariance, found.covariance.T)
    assert (np.linalg.eigvalsh(found.correlation) > 0.0).all()
    place = [found.names.index(name) for name in ("assimilation_maximum", "assimilation_light")]
    # What the canopy takes up at most and in weak light show in the same hours.
    assert abs(found.correlation[place[0], place[1]]) > 0.2


class DaysOfTwoFolds:
    """A log of which the first days are predicted well with a cause, and the others better by half."""

    def __init__(self, fall: float | None, *others: float | None) -> None:
        self.fall, self.others = fall, others

    def folds(self) -> list[DaysOfTwoFolds]:
        return [self, *(DaysOfTwoFolds(one) for one in self.others)]

    def run(self, stage: Stage) -> FreeRuns | None:
        if self.fall is None:
            return None
        left = 1.0 - self.fall * bool(stage.terms)
        return runs([[np.sqrt(left)] * 2] * 2)


@pytest.mark.parametrize(
    ("falls", "skill"), [((-0.1, 0.5), 0.2), ((-0.1, None), -0.1), ((None, 0.5), 0.5), ((None, None), None)]
)
def test_skill_is_asked_of_all_days(falls: tuple[float | None, ...], skill: float | None) -> None:
    prior = Gaussian.independent({"transmissivity": 0.7}, {"transmissivity": 0.1})
    before, after = (
        cast(Any, SimpleNamespace(turns=lambda _, stage=stage: [stage] * len(falls)))
        for stage in (Stage(prior, ()), Stage(prior, (ActiveTerm("co2_offset", 10.0, {}),)))
    )
    found = freerun.cross_validated_skill(cast(Any, DaysOfTwoFolds(*falls)), before, after)
    assert found == (None if skill is None else pytest.approx(skill))


@pytest.mark.slow
def test_a_turn_is_fitted_by_one_step_nearly_as_by_a_whole_search() -> None:
    known = nominal(SITE)
    log = virtual_log(16, seed=8, step=900.0, parameters=known | {"leakage_wind": 1.2 * known["leakage_wind"]})
    shown = prepare_log(log.with_columns({"air_co2": log["air_co2"] + 60.0}), SITE).record(0.0)
    split = split_days(shown, SITE.longitude)
    prior = Gaussian.independent(known, {name: 0.08 * abs(value) + 1e-9 for name, value in known.items()})
    days = LogDays(shown, split, sensitivity.day_runs(shown, split.day))
    told = (ActiveTerm("co2_offset", 40.0, {}),)
    own, *turns = Refittable(Stage(days.fit(prior, told), told), prior).turns(days)
    assert len(turns) == len(days.folds()) - 1 and own.terms == told
    for fold, turn in zip(days.folds()[1:], turns, strict=True):
        searched = fold.fit(prior, told)
        apart = (turn.posterior.mean - searched.mean) / prior.standard_deviation
        assert np.abs(apart).max() < 0.1 and turn.terms == told
    # The size that was told is too small; each turn's own days tell it as a search from afar does.
    for fold, turn in zip(days.folds()[1:], Refittable(own, prior, sized=True).turns(days)[1:], strict=True):
        together = fit_together(shown, fold.split.fit_rows, prior, {"co2_offset": 0.0}, {"co2_offset": {}})
        assert turn.terms[0].amplitude == pytest.approx(together.values["co2_offset:offset"], rel=0.05)


def test_a_fit_is_made_once_for_a_log_and_anew_for_one_with_other_inputs(
    moved: tuple[dict[str, float], Gaussian],
) -> None:
    _, known = moved
    record = prepare_log(virtual_log(8, seed=8, step=900.0), SITE).record(0.0)
    split = split_days(record, SITE.longitude)
    days = LogDays(record, split, sensitivity.day_runs(record, split.day))
    first, dark = days.fit(known, ()), {**record.inputs, "global_radiation": 0.5 * record.inputs["global_radiation"]}
    assert days.fit(known, ()) is first
    assert days.fit(known, (ActiveTerm("co2_offset", 60.0, {}),)).values != first.values
    assert replace(days, record=replace(record, inputs=dark)).fit(known, ()).values != first.values
