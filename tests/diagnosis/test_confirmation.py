"""A change asked once more of free runs: its size, its skill, and refusal where steps and runs do not agree."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.core.bundle import Estimate
from igrow.trainer.data import prepare_log
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.knowledge import ActiveTerm, Knowledge, knowledge_of
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.validation import confirmation
from igrow.trainer.diagnosis.validation.confirmation import confirmed
from igrow.trainer.fit import FittedModel
from tests.diagnosis.conftest import model_in_force
from tests.virtual_log import SITE, virtual_log


def change(size: float, onset: np.datetime64 | None = None) -> Estimated:
    """A sensor that is off, as time steps tell it."""
    hypothesis = cast(Any, SimpleNamespace(effect="air_temperature_offset"))
    term = ActiveTerm("air_temperature_offset", size, {}, onset)
    return Estimated(hypothesis, term, Estimate(size, 0.5 * size, 1.5 * size, "K"), 30.0, None, (term.effect,))


def known(model: FittedModel) -> Knowledge:
    """Return what is known of a greenhouse whose calibration taught what is missing even then."""
    return replace(knowledge_of(model, SITE, DEFAULT), history=cast(Any, object()))


@pytest.mark.parametrize("size", [0.4, 2.5])
def test_the_size_is_that_of_free_runs(size: float) -> None:
    telemetry = virtual_log(16, seed=3, step=900.0)
    columns = dict(telemetry.columns) | {"air_temperature": telemetry.columns["air_temperature"] + 1.0}
    model = model_in_force()
    log = log_days(prepare_log(replace(telemetry, columns=columns), SITE), model)
    found = confirmed(log, known(model), (), [change(size)], DEFAULT)
    assert found is not None
    assert found.term.amplitude == pytest.approx(1.0, abs=0.3)
    assert found.change_skill > DEFAULT.clear_skill
    # What is known of it keeps its share.
    assert (found.amplitude.low, found.amplitude.high) == pytest.approx(
        (0.5 * found.term.amplitude, 1.5 * found.term.amplitude)
    )


@pytest.mark.parametrize(("by_runs", "told"), [(0.9, True), (0.2, False), (5.0, False), (-1.0, False), (0.0, False)])
def test_where_steps_and_runs_tell_another_size_nothing_is_told(
    by_runs: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confirmation, "_by_runs", lambda *_: [by_runs])
    monkeypatch.setattr(confirmation, "cross_validated_skill", lambda *_: 0.1)
    log = cast(Any, SimpleNamespace(fit=lambda *_: None))
    found = confirmed(log, known(model_in_force()), (), [change(1.0)], DEFAULT)
    assert (found is not None) is told
    # Of a greenhouse that no calibration has shown runs tell no size: its parameters may be anything.
    unknown = confirmed(log, knowledge_of(model_in_force(), SITE, DEFAULT), (), [change(1.0)], DEFAULT)
    assert unknown is not None and unknown.term.amplitude == 1.0


def test_of_what_began_within_the_log_the_days_since_then_tell_the_size() -> None:
    telemetry = virtual_log(24, seed=3, step=900.0)
    began = telemetry.time[0] + np.timedelta64(10, "D")
    columns = {"air_temperature": telemetry.columns["air_temperature"] + 1.0 * (telemetry.time >= began)}
    model = model_in_force()
    log = log_days(prepare_log(replace(telemetry, columns=dict(telemetry.columns) | columns), SITE), model)
    prior = knowledge_of(model, SITE, DEFAULT).by_physics(DEFAULT)
    (since,) = confirmation._by_runs(log, prior, (), [change(0.5, began).term], DEFAULT) or (0.0,)
    assert since == pytest.approx(1.0, abs=0.3)
    late = change(0.5, began + np.timedelta64(8, "D")).term
    assert confirmation._by_runs(log, prior, (), [late], DEFAULT) is None
    nothing_complete = replace(log, split=replace(log.split, fit=np.zeros_like(log.split.fit)))
    assert confirmation._by_runs(nothing_complete, prior, (), [change(0.5).term], DEFAULT) is None
    drifts = replace(late, effect="humidity_drift", onset=began)
    assert confirmation._by_runs(log, prior, (drifts,), [change(0.5).term], DEFAULT) is None


def test_of_several_each_has_its_size_beside_the_others() -> None:
    """A sensor that nothing ails, held at what steps told of it, had a cause beside it refused for its size."""
    telemetry = virtual_log(16, seed=3, step=900.0)
    columns = dict(telemetry.columns) | {"air_temperature": telemetry.columns["air_temperature"] + 1.0}
    model = model_in_force()
    log = log_days(prepare_log(replace(telemetry, columns=columns), SITE), model)
    prior = knowledge_of(model, SITE, DEFAULT).by_physics(DEFAULT)
    humidity = ActiveTerm("humidity_offset", 4.0, {})
    right, nothing = confirmation._by_runs(log, prior, (), [change(0.5).term, humidity], DEFAULT) or (0.0, 0.0)
    assert right == pytest.approx(1.0, abs=0.3)
    assert abs(nothing) < 1.0
