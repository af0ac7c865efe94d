"""A greenhouse that no calibration has shown is asked by the same search, from the priors alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import DEFAULT, diagnose
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.design import amplitudes
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.learned.null_gains import read_unknown_gains
from igrow.trainer.diagnosis.search import history
from igrow.trainer.diagnosis.search.rounds import Search, search_of
from igrow.trainer.exporting import read_model
from igrow.trainer.fit import FittedModel
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.known_greenhouse import later
from tests.virtual_log import GREENHOUSE, SITE, virtual_log


def search(log: Log, model: FittedModel) -> Search:
    return search_of(log_days(log, model), SITE, knowledge_of(model, SITE, DEFAULT), frozenset(), DEFAULT)


@pytest.fixture(scope="module")
def darker() -> Log:
    """A log of a greenhouse that a quarter less light comes into than the model says."""
    parameters = GREENHOUSE | {"transmissivity": 0.75 * GREENHOUSE["transmissivity"]}
    return prepare_log(virtual_log(16, seed=9, step=900.0, parameters=parameters), SITE)


def test_it_is_laid_out_about_parameters_of_the_log_and_held_to_what_the_model_says_of_them(darker: Log) -> None:
    model = replace(model_in_force(), calibrated_on="another")
    asked, known = search(darker, model), knowledge_of(model, SITE, DEFAULT)
    design = asked.design(())
    fitted = design.line.parameters["transmissivity"]
    assert fitted == pytest.approx(0.75 * GREENHOUSE["transmissivity"], rel=0.15)
    # The refit starts there and has the prior of the model.
    np.testing.assert_allclose(design.prior.mean, known.prior.mean)
    # So has the null: none of the change of parameters is taken for granted.
    assert design.history is not None and not design.history.misfit.any()
    null = design.null_model()
    moved = dict(zip(amplitudes.keys(design), null.mean, strict=True))["parameter:transmissivity"]
    assert moved == pytest.approx(known.prior.values["transmissivity"] - fitted)


def test_of_effects_and_patterns_a_share_of_what_a_calibration_may_miss_is_expected(darker: Log) -> None:
    asked = search(darker, replace(model_in_force(), calibrated_on="another"))
    names = tuple(name for name in asked.history.amplitudes.names if not name.startswith("parameter:"))
    spread = DEFAULT.unknown_share * amplitudes.omission(names, DEFAULT)
    np.testing.assert_allclose(asked.history.amplitudes.marginal(names).standard_deviation, spread)


def test_it_has_bounds_of_its_own_and_neither_days_nor_parameters_are_asked(darker: Log) -> None:
    asked = search(darker, replace(model_in_force(), calibrated_on="another"))
    assert asked.null_gains == read_unknown_gains() and not asked.by_days
    rng = np.random.default_rng(0)
    assert (asked.changed_parameter(rng), asked.unexplained(rng), asked.history_after(())) == (None, (), None)


@pytest.mark.slow
def test_by_the_built_in_bundle_a_large_cause_is_told_and_nothing_without_it(quiet_log: Log) -> None:
    model = read_model(read_bundle(default_bundle_folder()), SITE)
    assert not diagnose(quiet_log, model).findings
    told = diagnose(quiet_log.with_columns({"air_co2": quiet_log.telemetry["air_co2"] + 150.0}), model)
    assert [one.effect for one in told.findings] == ["co2_offset"]
    assert wording.NOT_CALIBRATED in told.notes


def test_of_a_log_of_other_steps_the_colour_of_the_noise_is_learned(
    known_weeks: object, known_model: FittedModel
) -> None:
    log = later(known_weeks, known_weeks)  # type: ignore[arg-type]
    asked = search(log, known_model)
    design = asked.design(())
    assert design.history is not None and design.history.filters
    other = history.expected(replace(asked.history, step=300.0), asked.plain, asked.misfit)
    assert other.history is not None and not other.history.filters
    # What is expected of the greenhouse stays.
    np.testing.assert_array_equal(other.values[0], design.values[0])
    assert other.history.own_gains == design.history.own_gains
