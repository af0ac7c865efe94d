"""Which cause stands: compared beside its own noise, against its bounds, and against patterns without a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.diagnosis import compare, linear
from igrow.trainer.diagnosis.candidates import Pattern
from igrow.trainer.diagnosis.compare import Round
from igrow.trainer.diagnosis.design import Design
from igrow.trainer.diagnosis.linear import Term
from igrow.trainer.diagnosis.rules import DEFAULT
from tests.diagnosis.synthetic_design import Truth, in_fitted_noise, make_design

COLD, CLOCK = Pattern("heat", "cold weather", ("outdoor_temperature",)), Pattern("heat", "05 to 09 h", ("time",))


def judged(design: Design, explained: float = 0.0) -> Round:
    return compare.compare(in_fitted_noise(design), explained, np.random.default_rng(0))


def test_nothing_is_found_where_nothing_is_missing() -> None:
    for seed in range(5):
        found = judged(make_design(seed=seed))
        assert found.cause is None
        assert found.patterns == ()
        assert found.named is found.null


def test_a_cause_is_found_with_its_size_and_gain() -> None:
    found = judged(make_design(Truth({"lamp_heat": 0.3}, {})))
    assert found.cause is not None
    assert found.cause.hypothesis.effect == "lamp_heat"
    (size,) = found.named.amplitudes
    assert abs(size - 0.3) < 3.0 * found.named.deviations[0]
    # In white noise of unit size: half the squared size over its variance, 24 fit days of 24 hours, two balances.
    expected = 0.5 * 0.3**2 * 24 * 24 * 2
    assert found.cause.hypothesis.gain == pytest.approx(expected, rel=0.3)
    assert found.cause.bootstrap_p < 0.01


def test_beside_its_own_noise_a_large_cause_gains_more_than_in_noise_that_holds_it() -> None:
    design = in_fitted_noise(make_design(Truth({"lamp_heat": 0.5}, {}), sigma=0.2))
    null, term = design.null_model(), Term(design.columns("effect:lamp_heat")[0])
    none = compare.profile(design, null)
    own = compare.profile(design, null.with_term(term), none.whitening)
    scanned = linear.fit(design.grams, null.with_term(term)).solution.gain
    before = scanned - linear.fit(design.grams, null).solution.gain
    assert compare.gain(design, own, none) > 2.0 * before


def test_a_gain_below_the_bound_is_no_cause_and_above_it_is() -> None:
    design = make_design(Truth({"lamp_heat": 0.3}, {}))
    found = judged(design)
    assert found.cause is not None
    gained = found.cause.hypothesis.gain
    for bound, names in ((gained - 0.01, True), (gained + 0.01, False)):
        rules = replace(DEFAULT, least_gain_transferred=bound)
        assert (judged(replace(design, rules=rules)).cause is not None) is names


def test_what_such_logs_usually_show_is_no_cause() -> None:
    design = make_design(Truth({"lamp_heat": 0.3}, {}))
    assert judged(design).cause is not None
    assert judged(replace(design, null_amplitude={"lamp_heat": 0.6})).cause is None


def test_what_is_left_beyond_the_usual_size_is_the_gain_under_a_normal_prior() -> None:
    design = in_fitted_noise(make_design(Truth({"lamp_heat": 0.3}, {})))
    found = compare.compare(design, 0.0, np.random.default_rng(0)).cause
    assert found is not None
    assert found.beyond_null == pytest.approx(found.hypothesis.gain)
    deviation = found.profile.deviations[-1]
    usual = compare.compare(
        replace(design, null_amplitude={"lamp_heat": deviation}), 0.0, np.random.default_rng(0)
    ).cause
    assert usual is not None
    assert usual.beyond_null == pytest.approx(0.5 * found.hypothesis.gain)


def test_a_size_far_beyond_its_bounds_is_no_cause() -> None:
    # The bound is 0.6, and half as much again is let pass.
    assert judged(make_design(Truth({"lamp_heat": 0.8}, {}))).cause is not None
    assert judged(make_design(Truth({"lamp_heat": 1.2}, {}))).cause is None


def test_a_pattern_that_no_cause_explains_is_found_with_its_size() -> None:
    found = judged(make_design(Truth({}, {"heat:cold weather": 0.5}), patterns=(COLD,)))
    assert found.cause is None
    (pattern,) = found.patterns
    assert pattern.cause == COLD
    assert pattern.amplitude == pytest.approx(0.5, abs=0.1)


def test_a_pattern_replaces_a_cause_only_if_it_gains_far_more() -> None:
    truth = Truth({"lamp_heat": 0.3}, {"heat:cold weather": 0.35})
    assert judged(make_design(truth, patterns=(COLD,))).cause is not None
    truth = Truth({"lamp_heat": 0.3}, {"heat:cold weather": 0.6})
    assert judged(make_design(truth, patterns=(COLD,))).cause is None


def test_twice_as_much_is_asked_of_the_clock_alone() -> None:
    # Both gain about 100, between the bound of 65 and twice that.
    truths = {COLD: Truth({}, {"heat:cold weather": 0.42}), CLOCK: Truth({}, {"heat:05 to 09 h": 0.42})}
    assert judged(make_design(truths[COLD], patterns=(COLD,))).patterns
    assert not judged(make_design(truths[CLOCK], patterns=(CLOCK,))).patterns


def test_beside_causes_that_explained_much_a_pattern_must_explain_as_much() -> None:
    design = make_design(Truth({}, {"heat:cold weather": 0.5}), patterns=(COLD,))
    assert judged(design, explained=50.0).patterns
    assert not judged(design, explained=1000.0).patterns


def test_further_patterns_join_the_first_each_with_its_own_size() -> None:
    windy = Pattern("vapour", "wind speed", ("wind_speed",))
    truth = Truth({}, {"heat:cold weather": 0.5, "vapour:wind speed": -0.3})
    found = judged(make_design(truth, patterns=(COLD, windy))).patterns
    assert {one.cause: one.amplitude for one in found} == pytest.approx({COLD: 0.5, windy: -0.3}, abs=0.1)


def test_in_a_long_log_patterns_of_a_wrong_structure_must_gain_more() -> None:
    truth = Truth({}, {"heat:cold weather": 0.27})
    long = make_design(truth, patterns=(COLD,), days=85)
    assert not judged(long).patterns
    # Where time steps count the structure is right, and nothing grows.
    assert judged(replace(long, interval=900.0)).patterns


def test_a_term_that_begins_late_leaves_the_days_before_alone() -> None:
    design = in_fitted_noise(make_design(Truth({"lamp_heat": 0.4}, {}, onset=16)))
    null, (column,) = design.null_model(), design.columns("effect:lamp_heat")
    none = compare.profile(design, null)
    late, always = (
        compare.profile(design, null.with_term(Term(column, onset)), none.whitening) for onset in (16, None)
    )
    assert compare.gain(design, late, none) > compare.gain(design, always, none) > 0.0
    change = late.by_day - none.by_day
    assert np.abs(change[:16]).mean() < 0.1 * np.abs(change[16:]).mean()
