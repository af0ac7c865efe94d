"""Causes refitted where they are: sizes of the truth, bounds that let go, and causes that are confounded."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm, knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search.refit import Refitted, refit, twins_held
from igrow.trainer.diagnosis.search.rounds import search_of
from igrow.trainer.fit.gaussian import Gaussian
from tests.diagnosis.conftest import DAYS, STEP, greenhouse_log, model_in_force
from tests.virtual_log import SITE


def prepared(log: Log) -> Design:
    """Return the design of a log of which no calibration has told anything."""
    model = model_in_force()
    return search_of(log_days(log, model), SITE, knowledge_of(model, SITE, DEFAULT), frozenset(), DEFAULT).design(())


def together(design: Design, sizes: dict[str, float]) -> list[Refitted]:
    """Refit effects from sizes, their nonlinear parameters from typical values."""
    model = design.null_model()
    for name in sizes:
        model = model.with_term(Term(design.columns(f"effect:{name}")[0]))
    terms = [
        ActiveTerm(name, size, {one.name: one.typical for one in EFFECTS[name].shapes}) for name, size in sizes.items()
    ]
    return refit(design, linear.fit(design.grams, model), terms, ())


@pytest.mark.slow
def test_a_leak_has_its_size_and_form_wherever_the_refit_begins(leaky_log: Log) -> None:
    design = prepared(leaky_log)
    for begin in (0.03, 0.3):
        (found,) = together(design, {"wind_infiltration": begin})
        assert abs(found.term.amplitude - 0.12) < 2.0 * found.deviation
        assert found.term.amplitude == pytest.approx(0.12, rel=0.25)
        assert found.term.shape["exponent"] == pytest.approx(1.0, abs=2.0 * found.shape_deviation["exponent"])
        assert all(abs(size - 0.12) < 0.06 for size, _ in found.regimes.values())


def test_what_is_not_there_comes_back_from_its_bound(quiet_log: Log) -> None:
    bound = EFFECTS["wind_infiltration"].amplitude.high
    (found,) = together(prepared(quiet_log), {"wind_infiltration": bound})
    assert found.term.amplitude < 0.02 * bound
    assert 0.0 < found.deviation < bound


def test_two_ways_for_co2_to_leak_in_are_confounded_and_a_leak_and_a_sensor_are_not() -> None:
    count = round(DAYS * 86_400 / STEP)
    log = greenhouse_log(4, {"co2": np.full(count, 1.0 / 3.6e6)})
    log = log.with_columns({"air_temperature": log.telemetry["air_temperature"] + 2.0})
    design = prepared(log)
    both = together(design, {"co2_valve_leak": 1.0, "air_temperature_offset": 2.0})
    assert all(abs(one.term.amplitude) > one.deviation for one in both)
    for found, truth in zip(both, (1.0, 2.0), strict=True):
        assert abs(found.term.amplitude - truth) < 3.0 * found.deviation
    twins = together(design, {"co2_valve_leak": 0.5, "soil_respiration": 0.5})
    assert not all(abs(one.term.amplitude) > one.deviation for one in twins)


def test_parameters_that_terms_are_more_of_are_held_and_no_others() -> None:
    names = ("leakage_wind", "vent_stack", "transmissivity")
    prior = Gaussian(names, np.array([2.0, 3.0, 0.5]), np.diag([0.4, 0.6, 0.1]) ** 2 + 0.001)
    held = twins_held(prior, [ActiveTerm("wind_infiltration", 0.1, {}), ActiveTerm("lamp_heat", 0.2, {})], 0.1)
    assert (held.names, held.mean.tolist()) == (names, prior.mean.tolist())
    np.testing.assert_allclose(held.standard_deviation, prior.standard_deviation * np.array([0.1, 1.0, 1.0]))
    np.testing.assert_allclose(held.correlation, prior.correlation)
