"""Size, interval, beginning and confounded causes of what a round found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Candidate
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import scan
from igrow.trainer.diagnosis.search.change import Round, changed
from igrow.trainer.diagnosis.search.estimate import Estimated, estimate, normal_quantile, with_refitted, within_bounds
from igrow.trainer.diagnosis.search.refit import Refitted
from igrow.trainer.diagnosis.search.scan import Hypothesis
from tests.diagnosis.synthetic_design import Truth, in_fitted_noise, make_design, with_column

DAY = np.timedelta64(1, "D")


def estimated(design: Design) -> Estimated:
    rng = np.random.default_rng(0)
    found = estimate(changed(in_fitted_noise(design), 0.0, rng), rng)
    assert found is not None
    return found


def test_where_nothing_is_found_there_is_nothing_to_estimate() -> None:
    rng = np.random.default_rng(0)
    assert estimate(changed(in_fitted_noise(make_design()), 0.0, rng), rng) is None


def test_the_interval_of_a_size_is_that_of_least_squares_inflated() -> None:
    one = estimated(make_design(Truth({"lamp_heat": 0.3}, {})))
    # Unit columns in unit white noise on 24 fit days of 24 hours in two balances.
    deviation = 1.0 / np.sqrt(24 * 24 * 2)
    reach = one.amplitude.high - one.amplitude.value
    assert reach == pytest.approx(1.645 * DEFAULT.deviation_inflation * deviation, rel=0.3)
    assert one.amplitude.low < 0.3 < one.amplitude.high


def test_plain_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rules, inside = replace(DEFAULT, deviation_inflation=1.0), []
    for seed in range(40):
        # Large enough to be named in all forty: those that chance helps would be too large.
        one = estimated(make_design(Truth({"lamp_heat": 0.4}, {}), seed=seed, rules=rules))
        inside.append(one.amplitude.low <= 0.4 <= one.amplitude.high)
    # Forty intervals of 90 per cent, within three standard errors.
    assert np.mean(inside) >= 0.75


def test_a_cause_that_looks_the_same_is_confounded_with_it_and_one_that_does_not_is_not() -> None:
    leaks = tuple(Candidate(name, ()) for name in ("co2_valve_leak", "soil_respiration", "lamp_heat"))
    design = make_design(Truth({"co2_valve_leak": 0.3}, {}), candidates=leaks)
    assert estimated(design).confounded == ("co2_valve_leak",)
    (column,) = design.columns("effect:co2_valve_leak")
    twins = with_column(design, "effect:soil_respiration", design.values[column])
    assert set(estimated(twins).confounded) == {"co2_valve_leak", "soil_respiration"}


def test_what_gains_next_to_nothing_is_not_as_good_as_a_cause_that_gains_little() -> None:
    # A gain of some five nats, and a tenth of one: these lie within six.
    design, rng = in_fitted_noise(make_design(Truth({"lamp_heat": 0.11}, {}), seed=3)), np.random.default_rng(0)
    null = linear.fit(design.grams, design.null_model())
    scored = scan.score_candidates(design, null, [None], rng)
    (cause,) = (one for one in scored if one.effect == "lamp_heat")
    assert DEFAULT.least_unproven_change < cause.gain < DEFAULT.confounded_gain
    assert [one.effect for one in scored if 0.0 < one.gain < DEFAULT.least_unproven_change]
    named = linear.fit(design.grams, null.model.with_term(cause.term))
    found = estimate(Round(design, null, named, cause, ()), rng)
    assert found is not None and found.confounded == ("lamp_heat",)


def test_the_interval_of_a_beginning_holds_it() -> None:
    one = estimated(make_design(Truth({"lamp_heat": 0.5}, {}, onset=16)))
    assert one.onset is not None
    begun = np.datetime64("2020-03-01T00:00:00") + 16 * DAY
    assert one.onset.low <= begun <= one.onset.high
    assert abs(one.onset.time - begun) <= DAY
    assert one.onset.high - one.onset.low <= 5 * DAY
    assert one.term.onset == one.onset.time


def test_a_nonlinear_parameter_is_read_off_the_parabola_through_its_neighbours() -> None:
    values = (0.7, 1.0, 1.5, 2.0)
    shapes = tuple(Candidate("wind_infiltration", (("exponent", value),)) for value in values)
    design = make_design(candidates=shapes, sigma=0.1)
    rng = np.random.default_rng(1)
    base, slope = rng.normal(size=(2, *design.values.shape[1:]))
    columns = [base + 0.5 * (value - 1.2) * slope for value in values]
    for candidate, column in zip(shapes, columns, strict=True):
        design = with_column(design, f"effect:{candidate.key}", column)
    truth = base  # As at an exponent of 1.2, between two that are tried.
    design = with_column(design, "residual", design.values[0] - 0.5 * truth)
    assert estimated(design).term.shape["exponent"] == pytest.approx(1.2, abs=0.08)


BOUNDS = EFFECTS["co2_valve_leak"].amplitude


def leak(size: float) -> Estimated:
    cause = Hypothesis(Candidate("co2_valve_leak", ()), Term(0), 40.0, size, 5.0, 0.001)
    term = ActiveTerm("co2_valve_leak", size, {}, None)
    return Estimated(cause, term, Estimate(size, size - 0.5, size + 0.5, BOUNDS.unit), 40.0, None, ("co2_valve_leak",))


def test_a_size_beyond_its_bound_is_brought_back_and_its_interval_reaches_it() -> None:
    one = within_bounds(leak(1.4 * BOUNDS.high), make_design())
    assert one.term.amplitude == one.amplitude.value == one.amplitude.low == BOUNDS.high
    assert one.amplitude.high == 1.4 * BOUNDS.high + 0.5


def test_a_size_within_its_bounds_stays() -> None:
    assert within_bounds(leak(0.5 * BOUNDS.high), make_design()) == leak(0.5 * BOUNDS.high)


def test_a_refitted_interval_allows_for_what_no_covariance_knows() -> None:
    refitted = Refitted(ActiveTerm("co2_valve_leak", 1.0, {}), 0.2, {}, {"day": (1.1, 0.1)})
    one = with_refitted(leak(2.0), refitted, DEFAULT)
    reach = normal_quantile(DEFAULT) * np.hypot(DEFAULT.deviation_inflation * 0.2, DEFAULT.form_deviation * 1.0)
    assert (one.amplitude.value, one.amplitude.low) == pytest.approx((1.0, 1.0 - reach))
    assert one.regimes["day"].high == pytest.approx(1.1 + 1.6449 * DEFAULT.deviation_inflation * 0.1, rel=1e-4)


def test_the_quantile_of_an_interval_is_the_normal_distributions() -> None:
    assert normal_quantile(DEFAULT) == pytest.approx(1.6449, abs=1e-4)
    assert normal_quantile(replace(DEFAULT, confidence=0.95)) == pytest.approx(1.96, abs=1e-3)
