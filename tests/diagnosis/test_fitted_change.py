"""A change that time steps do not prove: told by fits to free runs, where unseen days bear it out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.data import Log
from igrow.trainer.diagnosis import DEFAULT, fitted_change
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.freerun import log_days
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, knowledge_of
from igrow.trainer.diagnosis.linear import Term
from igrow.trainer.diagnosis.search import Hypothesis
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.synthetic_design import Truth
from tests.diagnosis.test_parameter_change import with_parameters
from tests.virtual_log import SITE


def hypothesis(effect: str, amplitude: float) -> Hypothesis:
    return Hypothesis(Candidate(effect, ()), Term(0), 20.0, amplitude, 5.0, 0.001)


def closest(log: Log, known: Knowledge | None = None) -> tuple[str, float] | None:
    """What fits tell of a log, and the share of unseen days' error that it removes."""
    model, asked = model_in_force(), [hypothesis("co2_offset", 20.0), hypothesis("humidity_offset", 2.0)]
    design = with_parameters(Truth({}, {}), 1)
    found = fitted_change.closest(log_days(log, model), known or knowledge_of(model, SITE, DEFAULT), design, asked)
    return None if found is None else (found[0].effect, found[1])


def test_the_effect_that_brings_free_runs_closest_is_told_with_what_it_takes_off_unseen_days(quiet_log: Log) -> None:
    shown = quiet_log.telemetry["air_humidity"] + 6.0
    found = closest(quiet_log.with_columns({"air_humidity": shown}))
    assert found is not None
    effect, fall = found
    assert effect == "humidity_offset"
    assert fall > DEFAULT.least_change_fall


def test_where_nothing_has_changed_no_fit_takes_that_much(quiet_log: Log) -> None:
    found = closest(quiet_log)
    assert found is None or found[1] < DEFAULT.least_change_fall


def test_beside_a_term_that_began_within_the_log_nothing_is_fitted(quiet_log: Log) -> None:
    known = knowledge_of(model_in_force(), SITE, DEFAULT)
    begins = quiet_log.telemetry.time[0] + np.timedelta64(5, "D")
    begun = ActiveTerm("wind_infiltration", 0.05, {"exponent": 1.0}, begins)
    assert closest(quiet_log, replace(known, terms=(begun,))) is None
    before = replace(begun, onset=quiet_log.telemetry.time[0] - np.timedelta64(5, "D"))
    assert closest(quiet_log, replace(known, terms=(before,))) is not None


@pytest.mark.parametrize(("size", "told"), [(4.0, ["lamp_heat"]), (0.0, [])])
def test_what_gains_little_by_physics_is_not_fitted(size: float, told: list[str]) -> None:
    design = with_parameters(Truth({"lamp_heat": size}, {}), 4)
    promising = fitted_change.promising(design, np.random.default_rng(0))
    assert [one.effect for one in promising][:1] == told
    assert len(promising) <= DEFAULT.most_change_fits
