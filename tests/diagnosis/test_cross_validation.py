"""A change that time steps do not prove: told by days that no fit has seen, where both what is known bear it out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.core.arrays import Floats
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.trainer.data.splits import folds
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm, knowledge_of
from igrow.trainer.diagnosis.learned.null_gains import (
    NullGains,
    read_null_pattern_skills,
    read_null_skills,
)
from igrow.trainer.diagnosis.search import change, cross_validation, rounds, scan, unexplained
from igrow.trainer.diagnosis.search.change import Round
from igrow.trainer.diagnosis.search.cross_validation import CrossValidated, cross_validated
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.scales import CORRELATION_TIME
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.synthetic_design import Truth
from tests.diagnosis.test_parameter_change import NAMES, with_parameters
from tests.virtual_log import SITE

BY_PHYSICS = Gaussian(NAMES, np.array([PARAMETERS[name].value for name in NAMES]), np.diag([1e-4] * len(NAMES)))
"""About the parameters at which the designs stand."""
BY_DAYS = NullGains({}, 0.05)
"""What unseen days must show, where a test asks nothing else."""


def hypothesis(effect: str, *, onset: int | None = None, column: int = 0) -> Hypothesis:
    return Hypothesis(Candidate(effect, ()), Term(column, onset), 20.0, 1.0, 5.0, 0.001)


def of(design: Design, effect: str, onset: int | None = None) -> Hypothesis:
    """The hypothesis that an effect is missing, by its column of a design."""
    (column,) = design.columns(f"effect:{effect}")
    return hypothesis(effect, onset=onset, column=column)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_what_is_missing_makes_unseen_days_better_and_nothing_else_does() -> None:
    design = with_parameters(Truth({"lamp_heat": 0.4}, {}), 1)
    lamps, rain = cross_validated(design, BY_PHYSICS, [of(design, "lamp_heat"), of(design, "rain_cooling")])
    # A unit column in unit noise.
    assert lamps.skill == pytest.approx(0.4**2 / (1.0 + 0.4**2), abs=0.03)
    assert abs(rain.skill) < 0.01
    assert lamps.falls.shape == (2, design.split.days)


def test_what_began_within_a_log_makes_the_days_since_better() -> None:
    design = with_parameters(Truth({"lamp_heat": 0.6}, {}, onset=16), 1)
    always, since = cross_validated(design, BY_PHYSICS, [of(design, "lamp_heat"), of(design, "lamp_heat", 16)])
    assert since.skill > 1.5 * always.skill
    assert np.abs(since.falls[:, :16].sum()) < 0.01 < since.falls[:, 16:].sum()


def test_falls_are_those_of_fits_to_other_days() -> None:
    """Once by normal equations and projections, once by least squares on the days themselves."""
    design = with_parameters(Truth({"lamp_heat": 0.3}, {}, (0.01, 0.0, 0.02)), 3)
    one = of(design, "lamp_heat", 5)
    (found,) = cross_validated(design, BY_PHYSICS, [one])
    joint, column = design.null_model(), scan.column_of(design, one.term)
    held = list(design.block("parameter").columns)
    for fall, base, precision in (
        (found.falls[0], list(joint.base), joint.precision),
        (found.falls[1], held, BY_PHYSICS.precision),
    ):
        assert fall == pytest.approx(by_least_squares(design, design.values[base], precision, column), abs=1e-9)


def by_least_squares(design: Design, others: Floats, precision: Floats, column: Floats) -> Floats:
    """Return the falls of the squared error of each day, with a prior as rows of the system."""
    errors = design.values[0]
    scale = np.sqrt(np.mean(errors**2, axis=(1, 2)))[:, None, None]
    weight = np.sqrt(design.line.record.step / CORRELATION_TIME)
    root = np.linalg.cholesky(precision).T
    squares = np.zeros((2, len(errors), design.split.days))
    for fold in folds(design.split):
        seen = fold.fit[design.line.runs.day]
        for place, columns in enumerate((others, np.concatenate([others, column[None]]))):
            rows = weight * (columns / scale)[:, :, seen].reshape(len(columns), -1).T
            prior = np.pad(root, ((0, 0), (0, len(columns) - len(others))))
            right = np.append(-weight * (errors / scale)[:, seen].ravel(), np.zeros(len(root)))
            coefficients = np.linalg.lstsq(np.concatenate([rows, prior]), right, rcond=None)[0]
            left = errors / scale + np.tensordot(coefficients, columns / scale, axes=1)
            squares[place][:, ~seen] = np.sum(left[:, ~seen] ** 2, axis=-1)
    before, after = squares
    falls: Floats = np.mean((before - after) / before.sum(axis=-1, keepdims=True), axis=0)
    return falls


def test_what_the_history_expects_is_not_borne_out_by_physics_alone() -> None:
    """A calibration misses what lamps give in this house anyway: its errors without that look like a change."""
    plain = with_parameters(Truth({}, {}), 1)
    (column,) = plain.columns("effect:lamp_heat")
    assert plain.history is not None
    known = replace(plain, history=replace(plain.history, misfit=0.4 * plain.values[column]))
    (found,) = cross_validated(known, BY_PHYSICS, [of(known, "lamp_heat")])
    by_history, by_physics = found.falls.sum(axis=1)
    assert by_physics > 0.1
    assert by_history < 0.01
    assert found.skill < 0.4 * by_physics


def test_what_a_parameter_explains_altogether_has_no_skill() -> None:
    plain = with_parameters(Truth({}, {}), 1)
    (column,) = plain.columns("effect:lamp_heat")
    values = plain.values.copy()
    values[column] = 0.0
    (found,) = cross_validated(replace(plain, values=values), BY_PHYSICS, [of(plain, "lamp_heat")])
    assert found.skill == 0.0
    assert cross_validated(plain, BY_PHYSICS, []) == []


def test_an_effect_is_not_fitted_beyond_its_bounds() -> None:
    """Rain that warms: its column asks for what there cannot be."""
    design = with_parameters(Truth({"rain_cooling": -0.6}, {}), 1)
    (found,) = cross_validated(design, BY_PHYSICS, [of(design, "rain_cooling")])
    assert found.skill == 0.0


@pytest.mark.parametrize(("size", "named"), [(0.4, "lamp_heat"), (0.0, "")])
def test_the_change_that_unseen_days_bear_out_is_found(size: float, named: str) -> None:
    design = with_parameters(Truth({"lamp_heat": size}, {}), 1)
    found = cross_validation.find(design, BY_PHYSICS, rng())
    assert ("" if found is None or found.cause is None else found.cause.effect) == named


@pytest.mark.parametrize(("largest", "told"), [(0.5, False), (0.12, False), (0.09, True)])
def test_what_days_alone_tell_must_have_clearly_more_skill_than_where_nothing_has_changed(
    largest: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has .138 of it."""
    design = with_parameters(Truth({"lamp_heat": 0.4}, {}), 1)
    monkeypatch.setattr(cross_validation, "read_null_skills", lambda: NullGains({"lamp_heat": largest}, 0.01))
    assert (cross_validation.find(design, BY_PHYSICS, rng()) is not None) is told


@pytest.mark.parametrize(("size", "told"), [(4.0, ["lamp_heat"]), (0.0, [])])
def test_what_gains_little_is_not_asked_of_unseen_days(size: float, told: list[str]) -> None:
    design = with_parameters(Truth({"lamp_heat": size}, {}), 4)
    assert [one.effect for one in cross_validation.promising(design, rng())][:1] == told


def test_a_rival_may_have_begun_within_the_log() -> None:
    design = with_parameters(Truth({"lamp_heat": 1.0}, {}, onset=16), 1)
    null = linear.fit(design.grams, design.null_model())
    scored = scan.score_candidates(design, null, scan.onset_days(design), rng())
    (rival,) = cross_validation.rivals(design, hypothesis("rain_cooling"), scored)
    assert (rival.effect, rival.term.onset) == ("lamp_heat", 16)
    assert cross_validation.rivals(design, of(design, "lamp_heat"), scored) == []
    assert design.history is not None
    hidden = replace(design, history=replace(design.history, without=frozenset({"lamp_heat"})))
    assert cross_validation.rivals(hidden, hypothesis("rain_cooling"), scored) == []


def test_beside_a_cause_that_was_found_before_unseen_days_are_asked_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two causes steps may prove one alone; a third is not looked for where no more may be named."""
    design = with_parameters(Truth({}, {}), 1)
    null = linear.fit(design.grams, design.null_model())
    asked: list[Design] = []
    monkeypatch.setattr(rounds, "changed", lambda *_, **__: Round(design, null, null, None, ()))
    monkeypatch.setattr(cross_validation, "find", lambda design, *_: asked.append(design))
    searched = change_of(design)
    beside = replace(design, untestable=("co2_offset",))
    found = [cast(Any, SimpleNamespace(term=ActiveTerm("co2_offset", 80.0, {}), gain=50.0))]
    assert searched.judge(design, [], rng(), causes=True).cause is None
    assert searched.judge(beside, found, rng(), causes=True).cause is None
    assert searched.judge(design, found, rng(), causes=False).cause is None
    assert [one is two for one, two in zip(asked, (design, beside), strict=True)] == [True, True]


@pytest.mark.parametrize(("by_days", "asked"), [(True, 1), (False, 0)])
def test_where_days_unmake_what_steps_tell_another_is_asked_of_them(
    by_days: bool, asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A leak was met with silence: vents had gained more by steps, and days did not bear them out."""
    design = with_parameters(Truth({}, {}), 1)
    null = linear.fit(design.grams, design.null_model())
    nothing = Round(design, null, null, None, ())
    calls: list[Design] = []
    told = replace(nothing, cause=hypothesis("first"))
    monkeypatch.setattr(rounds, "changed", lambda *_, **__: told)
    monkeypatch.setattr(cross_validation, "settled", lambda *_: nothing)
    monkeypatch.setattr(cross_validation, "find", lambda design, *_: calls.append(design))
    searched = change_of(design, by_days=by_days)
    assert searched.judge(design, [], rng(), causes=True) is nothing
    assert len(calls) == asked
    pattern = hypothesis("pattern")
    monkeypatch.setattr(unexplained, "find", lambda *_: (pattern,))
    monkeypatch.setattr(rounds.Search, "design", lambda *_: design)
    assert searched.unexplained(rng()) == (pattern,) * asked


def change_of(design: Design, *, by_days: bool = True) -> rounds.Search:
    """Return a search for changes that has been laid out as a design."""
    unasked = cast(Any, None)
    known = knowledge_of(model_in_force(), SITE, DEFAULT)
    return rounds.Search(
        unasked, SITE, known, frozenset(), DEFAULT, unasked, design, np.zeros(0), NullGains({}, 8.0), by_days=by_days
    )


@pytest.mark.parametrize(
    ("falls", "proven", "named"),
    [
        (([0.01] * 4, [0.0] * 4), 20.0, "first"),
        (([-0.01] * 4, [0.01] * 4), 20.0, "other"),
        (([-0.03] * 4, [-0.01] * 4), 20.0, "first"),
        # Better on two days of four is no better.
        (([0.02] * 4, [0.09, 0.01, 0.0, 0.0]), 20.0, "first"),
        (([0.01] * 4, [0.2] * 4), 9.0, "other"),
        (([-0.01] * 4, [0.01] * 4), 9.0, ""),
    ],
)
def test_of_causes_that_gain_about_the_same_that_is_told_which_unseen_days_surely_tell(
    falls: tuple[list[float], list[float]], proven: float, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It must gain what it must itself, or make unseen days as much better as what only these tell."""
    assert settled_as(hypothesis("other"), falls, proven, monkeypatch) == named


def test_of_what_began_within_a_log_unseen_days_alone_are_not_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """What they must bear out was learned of what was there all the time."""
    assert settled_as(hypothesis("other", onset=9), ([0.01] * 4, [0.2] * 4), 9.0, monkeypatch) == ""
    assert settled_as(hypothesis("other", onset=9), ([0.01] * 4, [0.2] * 4), 20.0, monkeypatch) == "other"


@pytest.mark.parametrize(("proven", "named"), [(12.0, ""), (19.0, ""), (21.0, "first")])
def test_what_gains_little_more_than_it_must_unseen_days_must_show(
    proven: float, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its skill is no more than where nothing had changed; rain that gains far more may fall on few days."""
    known = NullGains({"first": 0.05}, 0.06)
    assert settled_as(hypothesis("other"), ([0.01] * 4, [0.0] * 4), proven, monkeypatch, known) == named
    assert settled_as(hypothesis("other"), ([0.013] * 4, [0.0] * 4), proven, monkeypatch, known) == "first"
    # Of what began within the log they must show as much as if they alone told it; the other must gain 10.
    begun = hypothesis("other", onset=9)
    assert settled_as(begun, ([0.0] * 4, [0.014] * 4), proven, monkeypatch, known) == ""
    assert settled_as(begun, ([0.0] * 4, [0.016] * 4), proven, monkeypatch, known) == "other"
    assert settled_as(begun, ([0.0] * 4, [0.014] * 4), proven + 14.0, monkeypatch, known) == "other"


@pytest.mark.parametrize(
    ("pattern", "gain", "proven", "outdone"),
    [
        ([0.06, 0.07, 0.06, 0.07], 15.0, 15.0, True),
        # It must do so by half as much again, and surely.
        ([0.05, 0.06, 0.05, 0.06], 15.0, 15.0, False),
        ([0.3, -0.01, -0.02, -0.03], 15.0, 15.0, False),
        # Steps tell the name alone, or by far.
        ([0.06, 0.07, 0.06, 0.07], 13.0, 15.0, False),
        ([0.06, 0.07, 0.06, 0.07], 15.0, 21.0, False),
    ],
)
def test_a_pattern_may_outdo_a_name_on_unseen_days(
    pattern: list[float], gain: float, proven: float, outdone: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = with_parameters(Truth({}, {}), 1)
    assert plain.history is not None
    design = replace(plain, history=replace(plain.history, null_gains=NullGains({}, 8.0)))
    null, first = linear.fit(design.grams, design.null_model()), hypothesis("first")
    course = replace(first, cause=Pattern("heat", "05 to 09 h", ("hour",)), gain=gain)
    falls = {id(first): np.full((2, 4), 0.04), id(course): np.array([pattern, pattern])}
    monkeypatch.setattr(scan, "score_patterns", lambda *_: [course])
    monkeypatch.setattr(
        cross_validation, "cross_validated", lambda _, __, asked: [CrossValidated(one, falls[id(one)]) for one in asked]
    )
    monkeypatch.setattr(change, "proven_gain", lambda *_: proven)
    judged = Round(design, null, null, first, ())
    found = cross_validation.with_what_outdoes_it(design, BY_PHYSICS, judged, rng())
    assert found == replace(judged, outdone_by=course if outdone else None)


def test_both_that_is_known_of_everything_else_counts() -> None:
    one = hypothesis("lamp_heat")
    assert CrossValidated(one, np.array([[0.02, 0.02], [0.08, 0.08]])).skill == pytest.approx(0.08)
    assert CrossValidated(one, np.array([[-0.02, -0.02], [0.08, 0.08]])).skill == pytest.approx(-0.04)
    assert CrossValidated(one, np.array([[-0.02, 0.0], [-0.03, 0.0]])).skill == pytest.approx(-0.03)


def settled_as(
    other: Hypothesis,
    falls: tuple[list[float], list[float]],
    proven: float,
    monkeypatch: pytest.MonkeyPatch,
    known: NullGains = BY_DAYS,
) -> str:
    """Return which of two causes is told in the end, by what unseen days must show (`known`)."""
    monkeypatch.setattr(cross_validation, "read_null_skills", lambda: known)
    plain = with_parameters(Truth({}, {}), 1)
    assert plain.history is not None
    design = replace(plain, history=replace(plain.history, null_gains=NullGains({"other": 10.0}, 8.0)))
    null, first = linear.fit(design.grams, design.null_model()), hypothesis("first")
    judged = Round(design, null, null, first, ())
    asked = [CrossValidated(one, np.array([own, own])) for one, own in zip((first, other), falls, strict=True)]
    monkeypatch.setattr(cross_validation, "rivals", lambda *_: [other])
    monkeypatch.setattr(cross_validation, "cross_validated", lambda *_: asked)
    monkeypatch.setattr(change, "proven_gain", lambda *_: proven)
    monkeypatch.setattr(change, "round_of", lambda design, null, one: Round(design, null, null, one, ()))
    found = cross_validation.settled(design, BY_PHYSICS, judged, rng())
    return "" if found.cause is None else found.cause.effect


@pytest.mark.parametrize("known", [read_null_skills(), read_null_pattern_skills()])
def test_what_came_with_the_trainer_is_a_share(known: NullGains) -> None:
    assert 0.0 < known.least < 1.0
    assert all(0.0 < share < 1.0 for share in known.largest.values())
