"""A parameter that has changed, or causes: which of both unseen days bear out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from igrow.core.bundle import Estimate
from igrow.trainer.diagnosis.design.freerun import FreeRuns, Refittable, Stage
from igrow.trainer.diagnosis.knowledge import ActiveTerm, knowledge_of
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.diagnosis.validation.correction import Corrected
from igrow.trainer.diagnosis.validation.parameter_or_causes import (
    explains_as_well,
    may_give_way,
    stands_in_its_place,
    with_parameter,
)
from igrow.trainer.fit import Gaussian
from tests.diagnosis.conftest import model_in_force
from tests.diagnosis.test_correction import cause, of


def test_no_parameter_takes_the_place_of_a_cause_in_a_balance_whose_twin_it_may_be() -> None:
    assert may_give_way([])
    assert may_give_way([of("humidity_offset")])
    assert not may_give_way([of("wind_infiltration")])
    assert not may_give_way([of("humidity_offset"), of("wind_infiltration")])


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
