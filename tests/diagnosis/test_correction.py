"""What stands on unseen days, and the model that comes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.core.bundle import EffectRecord, Estimate
from igrow.core.simulator.hybrid.record import Record, uptake
from igrow.trainer.data import Log
from igrow.trainer.diagnosis.answer.result import Finding
from igrow.trainer.diagnosis.answer.wording import discrepancy, finding
from igrow.trainer.diagnosis.answer.wording import parameter as parameter_finding
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.freerun import Stage
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm, knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search.estimate import Estimated, OnsetInterval
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.diagnosis.validation import correction
from igrow.trainer.diagnosis.validation.correction import (
    Corrected,
    corrected_crop,
    corrected_model,
    is_proven,
    same_in_all_regimes,
    until_outdone,
    without,
)
from igrow.trainer.fit import Gaussian
from igrow.trainer.fit.growth import built_in_crop
from tests.diagnosis.conftest import model_in_force

CROP = built_in_crop()
DAY = np.datetime64("2020-03-14T00:00:00", "s")


def cause(**values: float) -> Estimated:
    """A leak that stands: large, certain, and useful."""
    hypothesis = Hypothesis(Candidate("co2_valve_leak", ()), Term(0), 40.0, 1.0, 5.0, 0.001)
    one = Estimated(
        hypothesis, ActiveTerm("co2_valve_leak", 1.0, {}), Estimate(1.0, 0.6, 1.4, "g m-2 h-1"), 40.0, None,
        ("co2_valve_leak",), effect_to_noise=1.0, skill=0.1, change_skill=0.1,
    )  # fmt: skip
    return replace(one, **values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "stays"),
    [
        ({"change_skill": 0.03}, True),
        ({"change_skill": 0.02}, False),
        ({"change_skill": 0.02, "over_null": 2.0}, False),
        ({"change_skill": 0.02, "over_null": 3.0}, True),
        ({"change_skill": 0.005, "over_null": 3.0}, False),
        # Less than this is chance.
        ({"skill": 0.0, "change_skill": 0.2}, True),
        ({"skill": -0.01, "change_skill": 0.2}, False),
        ({"skill": 0.04, "change_skill": -0.1}, False),
        ({"change_skill": 0.1, "effect_to_noise": 0.1}, False),
    ],
)
def test_a_cause_must_make_unseen_days_better_and_the_shipped_model_no_worse(
    values: dict[str, float], stays: bool
) -> None:
    assert is_proven(cause(**values), DEFAULT) is stays


@pytest.mark.parametrize(("over_null", "kept"), [(2.0, ["lamp_heat"]), (0.9, [])])
def test_beside_a_change_that_is_refused_another_must_gain_enough_by_itself(
    over_null: float, kept: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dew on the cover was found beside a chimney that unseen days did not bear out, and went untold with it."""
    known = SimpleNamespace(prior=None, posterior=None, terms=(), history=object())
    refused = of("co2_valve_leak", change_skill=0.0, skill=-0.1, over_null=2.0)
    found = [refused, of("lamp_heat", change_skill=0.1, over_null=over_null)]

    def tried(_log: Any, _known: Any, one: Estimated, current: Stage, *_rest: Any) -> tuple[Estimated, Stage]:
        return one, replace(current, terms=(*current.terms, one.term))

    monkeypatch.setattr(correction, "_tried", tried)
    log = SimpleNamespace(fit=lambda *_asked: None)
    result = correction.correct(cast(Any, log), cast(Any, known), found, (), 5.0, DEFAULT)
    assert [one.effect for one in result.kept] == kept
    assert [one.effect for one in result.stages["corrected"].terms] == kept


def of(effect: str, **values: float) -> Estimated:
    """Return a cause that stands, of an effect."""
    one = cause(**values)
    named = replace(one.hypothesis, cause=Candidate(effect, ()))
    return replace(one, hypothesis=named, term=replace(one.term, effect=effect))


@pytest.mark.parametrize(
    ("values", "same"),
    [
        ({}, True),
        ({"night": 0.1}, True),
        ({"day": 0.8, "night": 1.2, "calm": 0.5, "windy": 1.1}, True),
        ({"day": 0.1, "night": 1.2}, False),
        ({"day": -0.9, "night": 1.2}, False),
        ({"day": -0.9, "night": -1.2}, True),
        ({"day": 1.0, "night": 1.0, "vents shut": 3.0, "vents open": 0.4}, False),
    ],
)
def test_a_cause_is_the_same_by_day_and_by_night_in_calm_and_in_wind(values: dict[str, float], same: bool) -> None:
    regimes = {name: Estimate(value, value - 0.1, value + 0.1, "1") for name, value in values.items()}
    assert same_in_all_regimes(regimes, DEFAULT) is same
    assert is_proven(replace(cause(), regimes=regimes), DEFAULT) is same


@pytest.mark.parametrize(("reach", "same"), [(0.2, False), (0.4, True)])
def test_a_size_that_is_hardly_known_speaks_against_no_other(reach: float, same: bool) -> None:
    """By night little is seen of an error by the sun: where it is nothing, or below, may be chance."""
    regimes = {"day": Estimate(1.0, 0.9, 1.1, "1"), "night": Estimate(-0.05, -0.05 - reach, -0.05 + reach, "1")}
    assert same_in_all_regimes(regimes, DEFAULT) is same


def test_the_corrected_model_keeps_correlations_adds_causes_and_remembers_where_it_was_fitted() -> None:
    model = model_in_force()
    old = EffectRecord("lamp_heat", "process", {"share": Estimate(0.1, 0.0, 0.2, "1")}, ("heat",))
    same = EffectRecord("co2_valve_leak", "process", {"rate": Estimate(9.0, 8.0, 10.0, "g m-2 h-1")}, ("co2",))
    model = replace(model, effects=(old, same), calibrated_on="")
    covariance = model.posterior.covariance.copy()
    covariance[0, 1] = covariance[1, 0] = 0.5 * np.sqrt(covariance[0, 0] * covariance[1, 1])
    posterior = Gaussian(model.posterior.names, 1.01 * model.posterior.mean, covariance)
    began = OnsetInterval(DAY, DAY - np.timedelta64(1, "D"), DAY + np.timedelta64(2, "D"))
    found = (
        finding(replace(cause(), onset=began)),
        discrepancy([Hypothesis(Pattern("heat", "rain", ("rain",)), Term(1), 50.0, 0.5, 4.0, 0.001)], DEFAULT),
    )
    errors = {"air_temperature": {"24_h": {"deployed": 2.0, "recalibrated": 1.0, "corrected": 0.5}}}
    result = Corrected({"corrected": Stage(posterior, ())}, ())
    corrected = corrected_model(model, result, found, errors, (DAY, DAY + np.timedelta64(28, "D")), CROP)
    assert corrected.posterior.correlation[0, 1] == pytest.approx(0.5)
    assert [one.name for one in corrected.effects] == ["lamp_heat", "co2_valve_leak"]
    leak = corrected.effects[1]
    assert leak.parameters["rate"] == Estimate(1.0, 0.6, 1.4, "g m-2 h-1")
    assert leak.onset is not None
    assert (leak.onset.low, leak.onset.time) == (datetime(2020, 3, 13, tzinfo=UTC), datetime(2020, 3, 14, tzinfo=UTC))
    assert corrected.calibrated_on == model.site.name
    assert [(one.before, one.after) for one in corrected.errors] == [(2.0, 0.5)]


def test_a_name_that_a_pattern_outdoes_goes_and_what_was_found_beside_it() -> None:
    first, second, third = of("humidity_offset"), of("rain_cooling"), of("wind_infiltration")
    course = Hypothesis(Pattern("co2", "05 to 09 h", ("hour",)), Term(0), 9.0, 1.0, 4.0, 0.001)
    assert until_outdone([first, second]) == ([first, second], ())
    assert until_outdone([first, replace(second, outdone_by=course), third]) == ([first], (course,))


def stage_of(parameter: str, share: float) -> tuple[Stage, Finding]:
    """Return the model in force with a parameter that has changed, and what is told of it."""
    posterior = model_in_force().posterior
    here = np.array([name == parameter for name in posterior.names])
    told = parameter_finding(
        ParameterChange(parameter, Estimate(share, share - 0.1, share + 0.1, "1"), None, 0.01, (parameter,), leads=True)
    )
    return Stage(posterior.moved(posterior.mean * (1.0 + share * here)), ()), told


def test_without_what_was_found_a_stage_is_as_it_was() -> None:
    painted, told = stage_of("transmissivity", -0.3)
    np.testing.assert_allclose(without(painted, told).posterior.mean, model_in_force().posterior.mean)
    leak, lamps = (ActiveTerm(name, 1.0, {}) for name in ("co2_valve_leak", "lamp_heat"))
    assert without(replace(painted, terms=(leak, lamps)), finding(cause())).terms == (lamps,)


@pytest.mark.parametrize("told", [True, False])
def test_a_cover_that_is_told_to_let_less_light_through_is_growth_that_is_lost(told: bool, quiet_log: Log) -> None:
    """What recalibration alone has moved may stand for something else: growth stays what it was."""
    model = model_in_force()
    stage, change = stage_of("transmissivity", -0.3)
    known = knowledge_of(model, model.site, DEFAULT)
    record = quiet_log.record(0.0)
    crop = corrected_crop(quiet_log, record, known, stage, (change,) if told else (), CROP)
    was, now = (growth_of(record, values) for values in (model.posterior.values, stage.posterior.values))
    kept = crop.conversion * now / (CROP.conversion * was)
    assert kept == pytest.approx(now / was if told else 1.0)
    assert now < 0.95 * was


def growth_of(record: Record, parameters: Mapping[str, float]) -> float:
    """Return the CO2 that the crop takes up in all, kg m-2."""
    return float(np.nansum(uptake(record, parameters, {})[0]))
