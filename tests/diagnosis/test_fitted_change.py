"""A change that time steps do not prove: told by fits to free runs, where unseen days bear it out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.trainer.data import Log
from igrow.trainer.diagnosis import DEFAULT, change, fitted_change, linear, rounds
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.compare import Contender, Round
from igrow.trainer.diagnosis.freerun import LogDays, Refittable, log_days
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, knowledge_of
from igrow.trainer.diagnosis.linear import Term
from igrow.trainer.diagnosis.null_gains import NullGains, read_null_falls
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.fit import evaluation
from igrow.trainer.fit.solver import DivergenceError
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.synthetic_design import Truth
from tests.diagnosis.test_parameter_change import with_parameters
from tests.virtual_log import SITE


def hypothesis(effect: str, amplitude: float) -> Hypothesis:
    return Hypothesis(Candidate(effect, ()), Term(0), 20.0, amplitude, 5.0, 0.001)


def told(log: Log, known: Knowledge | None = None) -> fitted_change.Fitted | None:
    """What fits tell of a log."""
    model, asked = model_in_force(), [hypothesis("co2_offset", 20.0), hypothesis("humidity_offset", 2.0)]
    design = with_parameters(Truth({}, {}), 1)
    known = known or knowledge_of(model, SITE, DEFAULT)
    return fitted_change.best(fitted_change.fitted(log_days(log, model), known, design, asked))


def test_the_effect_that_takes_most_off_unseen_days_is_told(quiet_log: Log) -> None:
    shown = quiet_log.telemetry["air_humidity"] + 6.0
    found = told(quiet_log.with_columns({"air_humidity": shown}))
    assert found is not None
    assert found.hypothesis.effect == "humidity_offset"
    assert found.fall > read_null_falls().needed("humidity_offset")


def test_where_nothing_has_changed_no_fit_takes_that_much(quiet_log: Log) -> None:
    found = told(quiet_log)
    assert found is None or found.fall < read_null_falls().needed(found.hypothesis.effect)


def test_what_no_unseen_day_bears_out_is_not_told(quiet_log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = quiet_log.with_columns({"air_humidity": quiet_log.telemetry["air_humidity"] + 6.0})
    measured, asked = evaluation.errors_of, log_days(shown, model_in_force()).split.fit_rows

    def errors_of(*arguments: Any) -> Any:
        return measured(*arguments) if np.array_equal(arguments[3], asked) else {}

    monkeypatch.setattr(fitted_change, "errors_of", errors_of)
    assert told(shown) is None


def test_what_a_model_cannot_run_with_on_other_days_is_not_told(
    quiet_log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    turns = Refittable.turns

    def diverges(one: Refittable, days: LogDays) -> Any:
        if one.sized and one.stage.terms[-1].effect == "humidity_offset":
            raise DivergenceError("the model runs out of all bounds")
        return turns(one, days)

    shown = quiet_log.with_columns({"air_humidity": quiet_log.telemetry["air_humidity"] + 6.0})
    monkeypatch.setattr(Refittable, "turns", diverges)
    found = told(shown)
    assert found is None or found.hypothesis.effect == "co2_offset"


def test_beside_a_term_that_began_within_the_log_nothing_is_fitted(quiet_log: Log) -> None:
    known = knowledge_of(model_in_force(), SITE, DEFAULT)
    begins = quiet_log.telemetry.time[0] + np.timedelta64(5, "D")
    begun = ActiveTerm("wind_infiltration", 0.05, {"exponent": 1.0}, begins)
    assert told(quiet_log, replace(known, terms=(begun,))) is None
    before = replace(begun, onset=quiet_log.telemetry.time[0] - np.timedelta64(5, "D"))
    assert told(quiet_log, replace(known, terms=(before,))) is not None


@pytest.mark.parametrize(("size", "told"), [(4.0, ["lamp_heat"]), (0.0, [])])
def test_what_gains_little_by_physics_is_not_fitted(size: float, told: list[str]) -> None:
    design = with_parameters(Truth({"lamp_heat": size}, {}), 4)
    promising = fitted_change.promising(design, np.random.default_rng(0))
    assert [one.effect for one in promising][:1] == told
    assert len(promising) <= DEFAULT.most_change_fits


def test_beside_a_cause_that_was_found_before_fits_are_asked_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two causes steps may prove one alone; a third is not looked for where no more may be named."""
    design = with_parameters(Truth({}, {}), 1)
    null = linear.fit(design.grams, design.null_model())
    asked: list[tuple[ActiveTerm, ...]] = []
    monkeypatch.setattr(rounds, "changed", lambda *_, **__: Round(design, null, null, None, ()))
    monkeypatch.setattr(fitted_change, "find", lambda _days, known, *_: asked.append(known.terms))
    known = knowledge_of(model_in_force(), SITE, DEFAULT)
    unasked = cast(Any, None)
    search = rounds.Change(
        unasked, SITE, known, frozenset(), DEFAULT, unasked, unasked, design, np.zeros(0), NullGains({}, 8.0)
    )
    term = ActiveTerm("co2_offset", 80.0, {})
    found = [cast(Any, SimpleNamespace(term=term, gain=50.0))]
    rng = np.random.default_rng(0)
    assert search.judge(design, [], rng, causes=True).cause is None
    assert search.judge(design, found, rng, causes=True).cause is None
    assert search.judge(design, found, rng, causes=False).cause is None
    assert asked == [known.terms, (*known.terms, term)]


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
        ((None, [0.2] * 4), 20.0, "first"),
    ],
)
def test_of_causes_that_gain_about_the_same_that_is_told_which_unseen_days_surely_tell(
    falls: tuple[list[float] | None, list[float]], proven: float, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It must gain what it must itself, or make unseen days as much better as what only fits tell."""
    plain = with_parameters(Truth({}, {}), 1)
    assert plain.history is not None
    design = replace(plain, history=replace(plain.history, null_gains=NullGains({"other": 10.0}, 8.0)))
    null = linear.fit(design.grams, design.null_model())
    first, other = hypothesis("first", 1.0), hypothesis("other", 1.0)
    judged = Round(design, null, null, contender(first), ())
    fitted = [
        fitted_change.Fitted(one, np.array([[[1.0] * 4, [1.0 - fall for fall in own]]]))
        for one, own in zip((first, other), falls, strict=True)
        if own is not None
    ]
    monkeypatch.setattr(fitted_change, "rivals", lambda *_: [other])
    monkeypatch.setattr(fitted_change, "fitted", lambda *_: fitted)
    monkeypatch.setattr(change, "proven_gain", lambda *_: proven)
    monkeypatch.setattr(change, "round_of", lambda design, null, one, _: Round(design, null, null, contender(one), ()))
    found = fitted_change.settled(cast(Any, None), cast(Any, None), design, judged, np.random.default_rng(0))
    assert ("" if found.cause is None else found.cause.hypothesis.effect) == named
    if named == "other" and proven < 10.0:
        assert found.cause is not None and found.cause.bootstrap_p == 0.0


def contender(one: Hypothesis) -> Contender:
    return Contender(one, one.gain, cast(Any, None), 0.3)


def test_a_run_without_a_finite_error_makes_no_day_better() -> None:
    """Not a number compares as neither less nor more, and passed every bound."""
    for before, after in ((1.0, np.nan), (1.0, np.inf), (np.inf, np.inf), (np.nan, 1.0)):
        errors = np.array([[[before, 1.0], [after, 0.5]]])
        assert fitted_change._fall(errors) == -np.inf
    assert fitted_change._fall(np.array([[[1.0, 1.0], [0.5, 0.5]]])) == pytest.approx(0.5)
