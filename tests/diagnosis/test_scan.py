"""The scan: exact scores of columns that are there, and no more than chance of those that are not."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Candidate
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.search import scan
from tests.diagnosis.synthetic_design import Truth, make_design, with_column

MANY = tuple(Candidate(name, ()) for name in ("humidity_offset", "co2_offset", "air_temperature_offset"))


def scored(design: Design, onsets: list[int | None] | None = None, seed: int = 0) -> list[scan.Hypothesis]:
    null = linear.fit(design.grams, design.null_model())
    return scan.score_candidates(design, null, onsets or [None], np.random.default_rng(seed))


def test_the_gain_and_size_of_a_column_are_those_of_the_joint_fit() -> None:
    design = make_design(Truth({"lamp_heat": 0.2}, {}, (0.5, -0.5, 0.2)))
    null = design.null_model()
    best = scored(design)[0]
    assert best.effect == "lamp_heat"
    (column,) = design.columns("effect:lamp_heat")
    joint = linear.fit(design.grams, null.with_term(Term(column)))
    assert best.amplitude == pytest.approx(joint.amplitudes[0], rel=1e-8)
    assert best.gain == pytest.approx(joint.solution.gain - linear.fit(design.grams, null).solution.gain, rel=1e-8)
    assert abs(best.amplitude - 0.2) < 3.0 * joint.deviations[0]
    assert best.p_value == pytest.approx(0.001)


def test_a_size_of_the_wrong_sign_gains_nothing() -> None:
    leak = (Candidate("co2_valve_leak", ()), Candidate("co2_offset", ()))
    assert scored(make_design(Truth({"co2_valve_leak": 0.3}, {}), candidates=leak))[0].effect == "co2_valve_leak"
    wrong = make_design(Truth({"co2_valve_leak": -0.3}, {}), candidates=leak)
    assert "co2_valve_leak" not in [one.effect for one in scored(wrong)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_size_beyond_either_bound_gains_what_the_bound_allows(sign: float) -> None:
    design = make_design(Truth({"lamp_heat": 1.2 * sign}, {}))
    best, size = scored(design)[0], design.candidates[0].definition.amplitude
    assert size.low == -size.high
    bound = sign * size.high
    (column,) = design.columns("effect:lamp_heat")
    null = design.null_model()
    held = with_column(design, "residual", design.values[0] + bound * design.values[column])
    at_bound = linear.fit(held.grams, null).solution.gain
    energy = 0.5 * float(
        np.sum(design.grams.products[design.grams.fit, 0, 0]) - np.sum(held.grams.products[held.grams.fit, 0, 0])
    )
    assert best.gain == pytest.approx(energy + at_bound - linear.fit(design.grams, null).solution.gain, rel=1e-8)


def test_the_smallest_p_value_of_columns_that_are_not_there_is_uniform() -> None:
    smallest = []
    for seed in range(80):
        design = make_design(candidates=MANY, parameters=2, days=40, seed=seed)
        null = linear.fit(design.grams, design.null_model())
        columns, bounds = design.block("effect").columns, np.tile([-1e9, 1e9], (3, 1))
        found = scan.scan(design.grams, null, columns, [None] * 3, [None], bounds, np.random.default_rng(seed), 199)
        smallest.append(found.p_value.min())
    # Of eighty uniform numbers, within three standard errors.
    for share in (0.1, 0.5):
        reach = 3.0 * np.sqrt(share * (1.0 - share) / 80)
        assert abs(np.mean(np.array(smallest) < share) - share) < reach


def test_the_day_on_which_an_effect_begins_is_found() -> None:
    design = make_design(Truth({"lamp_heat": 0.5}, {}, onset=14))
    best = scored(design, scan.onset_days(design))[0]
    # Days 11 and 12 are held out: nothing tells which of them it was, and the middle one is taken.
    assert best.term.onset in {13, 14}


def test_beginnings_stay_away_from_both_ends_and_are_few_in_a_long_log() -> None:
    assert scan.onset_days(make_design(days=16)) == [None, *range(3, 12)]
    assert len(scan.onset_days(make_design(days=90))) <= 1 + 30


@pytest.mark.parametrize(("gains", "middle"), [([1.0, 3.0, 3.0, 3.0, 2.0], 2), ([5.0, 1.0], 0)])
def test_of_several_equal_beginnings_the_middle_one_is_taken(gains: list[float], middle: int) -> None:
    assert scan.middle_of_best(np.array(gains)) == middle


def test_a_log_that_shows_no_effect_has_no_candidate() -> None:
    """Beside a cause the model of a real log had run to 300,000 K: nothing showed there, and the search fell over."""
    bare = make_design(candidates=(), seed=1)
    null = linear.fit(bare.grams, bare.null_model())
    assert scan.score_candidates(bare, null, [None, 5], np.random.default_rng(0)) == []
