"""The model that is shipped is refitted with parameters that may move further than those that causes are judged by."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design.freerun import LogDays, Refittable, Stage
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, knowledge_of
from igrow.trainer.diagnosis.search.actuators import Completed
from igrow.trainer.diagnosis.validation import shipping
from igrow.trainer.diagnosis.validation.correction import Corrected
from igrow.trainer.diagnosis.validation.shipping import refitted, shipped
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.solver import DivergenceError
from tests.diagnosis.conftest import model_in_force
from tests.virtual_log import SITE

LAMPS = (ActiveTerm("lamp_heat", 0.1, {}),)


class Fits:
    """Stands for the days of a log: a fit ends where its prior does."""

    def __init__(self) -> None:
        self.asked: list[tuple[Gaussian, tuple[ActiveTerm, ...]]] = []

    def fit(self, prior: Gaussian, terms: tuple[ActiveTerm, ...], start: Any, added: Any) -> Gaussian:
        assert start and added is None
        self.asked.append((prior, terms))
        return prior


def known() -> Knowledge:
    return knowledge_of(model_in_force(), SITE, DEFAULT)


def corrected(knowledge: Knowledge, parameter: str = "") -> Corrected:
    recalibrated = Stage(knowledge.prior, ())
    stages = {"deployed": Stage(knowledge.posterior, ()), "recalibrated": recalibrated}
    told = cast(Any, SimpleNamespace(parameter=parameter)) if parameter else None
    return Corrected({**stages, "corrected": Stage(knowledge.prior, LAMPS)}, (), told)


def completed(days: Fits, recalibrated: Stage | None = None) -> Completed:
    fields = dict.fromkeys(Completed.__dataclass_fields__, cast(Any, ()))
    return Completed(**{**fields, "days": days, "recalibrated": recalibrated})


def test_both_stages_are_refitted_beside_their_causes_and_the_deployed_is_as_it_was() -> None:
    knowledge, days = known(), Fits()
    _, result = shipped(completed(days), cast(Any, None), knowledge, corrected(knowledge))
    wide = knowledge.shipped_prior
    assert days.asked == [(wide, ()), (wide, LAMPS)]
    assert result.stages["corrected"] == Stage(wide, LAMPS)
    assert result.stages["deployed"].posterior is knowledge.posterior
    assert np.all(wide.standard_deviation > knowledge.prior.standard_deviation)


@pytest.mark.parametrize(("skill", "free"), [(0.02, True), (0.0, True), (-0.01, False), (None, False)])
def test_where_a_parameter_has_changed_the_others_need_not_move_far(
    skill: float | None, free: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A third less light, told, predicted days better than any model whose every parameter may move by a quarter."""
    knowledge, days = known(), Fits()
    compared: list[Refittable] = []

    def judged(_days: Any, *both: Refittable) -> float | None:
        compared.extend(both)
        return skill

    monkeypatch.setattr(shipping, "cross_validated_skill", judged)
    told = corrected(knowledge, "transmissivity")
    _, result = shipped(completed(days), cast(Any, None), knowledge, told)
    before, after = compared
    assert (before.prior, after.stage) == (knowledge.shipped_prior, told.stages["corrected"])
    wider = after.prior.standard_deviation > knowledge.prior.standard_deviation + 1e-12
    assert [name for name, more in zip(after.prior.names, wider, strict=True) if more] == ["transmissivity"]
    assert result.stages["corrected"] is (told if free else result).stages["corrected" if free else "recalibrated"]
    assert result.stages["recalibrated"].posterior is knowledge.shipped_prior


def test_where_an_actuator_is_not_logged_the_model_without_it_is_refitted_to_the_log_as_it_is() -> None:
    knowledge, days, logged = known(), Fits(), Fits()
    before = Stage(knowledge.prior, LAMPS)
    around, _ = shipped(completed(days, before), cast(Any, logged), knowledge, corrected(knowledge))
    assert logged.asked == [(knowledge.shipped_prior, LAMPS)]
    assert around.recalibrated == Stage(knowledge.shipped_prior, LAMPS)


def test_what_runs_out_of_all_bounds_stays_as_it_was() -> None:
    def runs_away(*_: Any) -> Gaussian:
        raise DivergenceError("it ran away")

    knowledge = known()
    stage = Stage(knowledge.prior, LAMPS)
    log = cast(LogDays, SimpleNamespace(fit=runs_away))
    assert refitted(stage, log, knowledge.shipped_prior) is stage


@pytest.mark.parametrize("share", [0.08, 0.25])
def test_the_shipped_prior_is_about_the_model_in_force(share: float) -> None:
    knowledge = known()
    names, values = knowledge.shipped_prior.names, knowledge.posterior.values
    assert knowledge.shipped_prior.mean == pytest.approx([values[name] for name in names])
    wide = {DEFAULT.shipped_drift: knowledge.shipped_prior, DEFAULT.parameter_drift: knowledge.prior}[share]
    place = names.index("transmissivity")
    assert wide.standard_deviation[place] >= share * values["transmissivity"]
