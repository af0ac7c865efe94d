"""What stands on unseen days, and the model that comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from igrow.core.bundle import EffectRecord, Estimate
from igrow.trainer.diagnosis.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.correction import (
    Corrected,
    corrected_model,
    explains_as_well,
    is_proven_change,
    may_give_way,
    same_in_all_regimes,
    stands,
    stands_in_its_place,
    until_outdone,
    with_parameter,
)
from igrow.trainer.diagnosis.estimate import Estimated, OnsetInterval
from igrow.trainer.diagnosis.freerun import FreeRuns, Refittable, Stage
from igrow.trainer.diagnosis.knowledge import ActiveTerm, knowledge_of
from igrow.trainer.diagnosis.linear import Term
from igrow.trainer.diagnosis.parameter_change import ParameterChange
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import Hypothesis
from igrow.trainer.diagnosis.wording import discrepancy, finding
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
        ("co2_valve_leak",), bootstrap_p=0.1, effect_to_noise=1.0, skill=0.1,
    )  # fmt: skip
    return replace(one, **values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "stays"),
    [
        ({}, True),
        ({"effect_to_noise": 0.14}, False),
        ({"skill": 0.02}, True),
        ({"skill": 0.02, "bootstrap_p": 0.6}, False),
        ({"skill": 0.04, "bootstrap_p": 0.6}, True),
        ({"skill": 0.005}, False),
        ({"skill": -0.1}, False),
    ],
)
def test_a_cause_stands_if_it_is_large_and_helps_on_unseen_days(values: dict[str, float], stays: bool) -> None:
    assert stands(cause(**values), [], DEFAULT) is stays


@pytest.mark.parametrize(
    ("values", "stays"),
    [
        ({}, True),
        ({"skill": 0.02}, False),
        ({"bootstrap_p": 0.3}, False),
        ({"gain": 7.0}, False),
        ({"gain": 9.0}, True),
    ],
)
def test_beside_another_a_cause_must_do_more(values: dict[str, float], stays: bool) -> None:
    assert stands(cause(**values), [cause()], DEFAULT) is stays


@pytest.mark.parametrize(
    ("values", "stays"),
    [
        ({"change_skill": 0.03, "bootstrap_p": 0.9}, True),
        ({"change_skill": 0.02, "bootstrap_p": 0.0}, False),
        ({"change_skill": 0.02, "over_null": 2.0}, False),
        ({"change_skill": 0.02, "over_null": 3.0}, True),
        ({"change_skill": 0.005, "over_null": 3.0}, False),
        # Less than this is chance.
        ({"skill": -0.01, "change_skill": 0.2, "bootstrap_p": 0.9}, True),
        ({"skill": -0.03, "change_skill": 0.2, "bootstrap_p": 0.0}, False),
        ({"skill": 0.04, "change_skill": -0.1, "bootstrap_p": 0.9}, False),
        ({"change_skill": 0.1, "bootstrap_p": 0.1, "effect_to_noise": 0.1}, False),
    ],
)
def test_a_change_must_make_unseen_days_better_and_the_shipped_model_no_worse(
    values: dict[str, float], stays: bool
) -> None:
    assert is_proven_change(cause(**values), [], DEFAULT) is stays


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
    assert stands(replace(cause(), regimes=regimes), [], DEFAULT) is same


@pytest.mark.parametrize(("reach", "same"), [(0.2, False), (0.4, True)])
def test_a_size_that_is_hardly_known_speaks_against_no_other(reach: float, same: bool) -> None:
    """By night little is seen of an error by the sun: where it is nothing, or below, may be chance."""
    regimes = {"day": Estimate(1.0, 0.9, 1.1, "1"), "night": Estimate(-0.05, -0.05 - reach, -0.05 + reach, "1")}
    assert same_in_all_regimes(regimes, DEFAULT) is same


def test_the_corrected_model_keeps_correlations_adds_causes_and_remembers_where_it_was_fitted() -> None:
    model = model_in_force()
    old = EffectRecord("lamp_heat", "process", {"share": Estimate(0.1, 0.0, 0.2, "1")}, ("heat",))
    same = EffectRecord("co2_valve_leak", "process", {"rate": Estimate(9.0, 8.0, 10.0, "g m-2 h-1")}, ("co2",))
    model = replace(model, effects=(old, same), discrepancy={"heat:cold weather": 0.1}, calibrated_on="")
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
    corrected = corrected_model(model, result, found, errors, {}, (DAY, DAY + np.timedelta64(28, "D")), CROP)
    assert corrected.posterior.correlation[0, 1] == pytest.approx(0.5)
    assert [one.name for one in corrected.effects] == ["lamp_heat", "co2_valve_leak"]
    leak = corrected.effects[1]
    assert leak.parameters["rate"] == Estimate(1.0, 0.6, 1.4, "g m-2 h-1")
    assert leak.onset is not None
    assert (leak.onset.low, leak.onset.time) == (datetime(2020, 3, 13, tzinfo=UTC), datetime(2020, 3, 14, tzinfo=UTC))
    assert corrected.calibrated_on == model.site.name
    assert corrected.discrepancy == {}
    assert [(one.before, one.after) for one in corrected.errors] == [(2.0, 0.5)]


def of(effect: str) -> Estimated:
    hypothesis = Hypothesis(Candidate(effect, ()), Term(0), 40.0, 1.0, 5.0, 0.001)
    return replace(cause(), hypothesis=hypothesis)


def test_no_parameter_takes_the_place_of_a_cause_in_a_balance_whose_twin_it_may_be() -> None:
    assert may_give_way([])
    assert may_give_way([of("humidity_offset")])
    assert not may_give_way([of("wind_infiltration")])
    assert not may_give_way([of("humidity_offset"), of("wind_infiltration")])


def test_a_name_that_a_pattern_outdoes_goes_and_what_was_found_beside_it() -> None:
    first, second, third = of("humidity_offset"), of("rain_cooling"), of("wind_infiltration")
    course = Hypothesis(Pattern("co2", "05 to 09 h", ("hour",)), Term(0), 9.0, 1.0, 4.0, 0.001)
    assert until_outdone([first, second]) == ([first, second], ())
    assert until_outdone([first, replace(second, outdone_by=course), third]) == ([first], (course,))


class DaysThatErr:
    """Unseen days on which each model errs as told: by physics, with a parameter free, with a sensor's fault."""

    def __init__(self, plain: float, freed: float, faulty: float) -> None:
        self.errors = plain, freed, faulty

    def folds(self) -> tuple[DaysThatErr, ...]:
        """All days are like these."""
        return self, self

    def fit(self, prior: Gaussian, _terms: Sequence[ActiveTerm]) -> Gaussian:
        """Half of the light comes through the cover, where that may be."""
        here = np.array([name == "transmissivity" for name in prior.names])
        return prior.moved(prior.mean * (1.0 - 0.5 * here)) if self._is_free(prior) else prior

    def run(self, stage: Stage) -> FreeRuns:
        plain, freed, faulty = self.errors
        error = faulty if stage.terms else freed if self._is_free(stage.posterior) else plain
        return FreeRuns({}, {"air_humidity": np.full((96, 4), error)}, np.arange(4))

    def _is_free(self, known: Gaussian) -> bool:
        return known.deviations["transmissivity"] > 0.5 * known.values["transmissivity"]


@pytest.mark.parametrize(
    ("plain", "freed", "faulty", "kept", "named"),
    [
        (3.0, 1.0, 2.0, True, True),
        (3.0, 1.0, 4.0, True, True),
        (3.0, 2.0, 1.0, True, False),
        (3.0, 2.0, 2.0, True, False),
        (3.0, 3.0, 4.0, True, False),
        (3.0, 2.0, 1.0, False, True),
        (3.0, 3.0, 1.0, False, False),
    ],
)
def test_a_parameter_takes_the_place_of_a_sensors_fault_where_unseen_days_ask_for_it(
    plain: float, freed: float, faulty: float, kept: bool, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Refittable, "turns", lambda one, log: [one.stage for _ in log.folds()])
    model = model_in_force()
    knowledge = knowledge_of(model, model.site, DEFAULT)
    fault = replace(cause(), term=ActiveTerm("humidity_offset", -5.0, {}))
    causes = (fault,) if kept else ()
    stages = {name: Stage(knowledge.prior, ()) for name in ("deployed", "recalibrated")}
    stages["corrected"] = Stage(knowledge.prior, tuple(one.term for one in causes))
    change = ParameterChange("transmissivity", Estimate(-0.7, -0.8, -0.6, "1"), None, 0.001, ("transmissivity",), False)
    days: Any = DaysThatErr(plain, freed, faulty)
    rivals = [one.term for one in causes]
    told = with_parameter(days, knowledge, Corrected(stages, causes), change, rivals, DEFAULT)
    assert (told.parameter is not None) is named
    if told.parameter is not None:
        assert told.parameter.share.value == pytest.approx(-0.5)
    assert told.kept == (() if named else causes)
    assert told.stages["corrected"].terms == (() if named else stages["corrected"].terms)


@pytest.mark.parametrize(
    ("faulty", "gain", "stays"),
    [
        # It explains as much by the search.
        (2.9, 200.0, True),
        # A humidity sensor by 15 % off looked, to the search, like leaves that transpire three times as much.
        (1.0, 10.0, True),
        (1.99, 10.0, False),
        (2.5, 10.0, False),
    ],
)
def test_causes_stand_in_the_place_of_a_parameter_that_predicts_unseen_days_worse(
    faulty: float, gain: float, stays: bool
) -> None:
    known = knowledge_of(model_in_force(), model_in_force().site, DEFAULT).prior
    freed = known.widened_along(known.mean * np.array([name == "transmissivity" for name in known.names]))
    fault = replace(cause(gain=gain), term=ActiveTerm("humidity_offset", -5.0, {}))
    plain = Corrected({"corrected": Stage(known, ())}, (), refused=Stage(freed, ()))
    beside = Corrected({"corrected": Stage(known, (fault.term,))}, (fault,))
    change = ParameterChange(
        "transmissivity", Estimate(-0.7, -0.8, -0.6, "1"), None, 0.001, ("transmissivity",), leads=True, gain=400.0
    )
    days: Any = DaysThatErr(3.0, 2.0, faulty)
    assert stands_in_its_place(days, beside, (), plain, change, DEFAULT) is stays
    assert not stands_in_its_place(days, replace(beside, kept=()), (), plain, change, DEFAULT)
    assert stands_in_its_place(days, beside, (), replace(plain, refused=None), change, DEFAULT) is (gain == 200.0)


def test_of_a_parameter_that_explains_far_more_a_cause_is_a_part() -> None:
    """Half as much air through the vents was told as a sensor that is off, at a third of the gain."""
    share = Estimate(-0.4, -0.5, -0.3, "1")
    change = ParameterChange("ventilation", share, None, 0.001, ("ventilation",), leads=True, gain=80.0)
    assert explains_as_well([cause(gain=40.0)], change, DEFAULT)
    assert explains_as_well([cause(gain=20.0), cause(gain=20.0)], change, DEFAULT)
    assert not explains_as_well([cause(gain=20.0)], change, DEFAULT)
    assert not explains_as_well([], change, DEFAULT)
