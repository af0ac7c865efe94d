"""An actuator that the log lacks: traced to what is withheld, by name, with the course that the rules gave it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.simulator.hybrid.nominal import site_record
from igrow.trainer.data import Log
from igrow.trainer.diagnosis import DEFAULT, Diagnosis, diagnose
from igrow.trainer.diagnosis.design import sensitivity
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.search import actuators
from igrow.trainer.fit.solver import DivergenceError
from tests.diagnosis.conftest import DAYS, STEP, greenhouse_log, model_in_force
from tests.made_once import made_once
from tests.virtual_log import SITE


@pytest.fixture(scope="module")
@made_once
def unlit(quiet_log: Log) -> Diagnosis:
    return diagnose(quiet_log.without("lamp_power"), model_in_force())


@pytest.mark.slow
def test_lamps_that_the_log_lacks_are_named_as_such(unlit: Diagnosis, quiet_log: Log) -> None:
    found = unlit.findings[0]
    assert (found.effect, found.kind) == ("lamp_power", "actuator")
    assert unlit.verdict == "named"
    assert found.parameters["share"].low < 1.0 < found.parameters["share"].high
    assert "The log lacks the lamp power" in found.sentence
    # The log lacks it nevertheless, and no effect goes into the corrected model for it.
    assert "lamp_power" in unlit.missing
    assert unlit.corrected.effects == ()


@pytest.mark.slow
def test_errors_are_those_of_the_log_as_it_is_until_the_correction(
    unlit: Diagnosis, quiet_diagnosis: Diagnosis
) -> None:
    whole = quiet_diagnosis.errors["air_temperature"]["24_h"]
    day = unlit.errors["air_temperature"]["24_h"]
    assert day["deployed"] > 1.2 * whole["deployed"]
    assert day["recalibrated"] > 1.2 * whole["recalibrated"]
    assert day["corrected"] < 1.1 * whole["recalibrated"]


@pytest.mark.parametrize("column", ["rail_pipe_temperature", "energy_screen"])
def test_the_course_of_the_rules_is_what_the_computer_did(quiet_log: Log, column: str) -> None:
    model, log = model_in_force(), quiet_log.without(column)
    did = quiet_log.record(0.0).inputs[column]
    told = actuators.courses(log, log_days(log, model).record, model)[column]
    assert np.corrcoef(did, told)[0, 1] > 0.8


def test_nothing_is_looked_for_where_the_log_lacks_no_actuator(quiet_log: Log) -> None:
    model = model_in_force()
    days, known = log_days(quiet_log, model), knowledge_of(model, SITE, DEFAULT)
    done = actuators.complete(quiet_log, days, model, known, DEFAULT)
    assert done == actuators.Completed(days, (), None)


def test_a_log_lacks_only_what_the_site_has(quiet_log: Log) -> None:
    bare = quiet_log.without("grow_pipe_temperature", "lamp_power").telemetry
    greenhouse = SITE.greenhouse
    without = replace(SITE, greenhouse=replace(greenhouse, grow_pipe_heat_transfer=0.0, lamps=None))
    assert {"grow_pipe_temperature", "lamp_power"} <= set(site_record(bare, SITE, 900.0).missing)
    assert not {"grow_pipe_temperature", "lamp_power"} & set(site_record(bare, without, 900.0).missing)


@pytest.fixture(scope="module")
def dark_log() -> Log:
    """The lamps are asked for, and their breaker is out; the envelope leaks by more than the model knows."""
    rows = round(DAYS * 86_400 / STEP)
    leak = np.full(rows, 0.3 * SITE.greenhouse.mean_height / 3600.0)
    return greenhouse_log(3, {"air_exchange": leak}, followed={"lamp_on": np.zeros(rows)})


@pytest.mark.parametrize(("log", "share"), [("quiet_log", 1.0), ("dark_log", 0.0)])
def test_the_share_of_a_course_is_found_beside_the_parameters(
    log: str, share: float, request: pytest.FixtureRequest
) -> None:
    model, seen = model_in_force(), request.getfixturevalue(log).without("lamp_power")
    days, known = log_days(seen, model), knowledge_of(model, SITE, DEFAULT)
    trial = actuators.with_inputs(days, actuators.courses(seen, days.record, model))
    found = actuators.share_of_course(days, trial, known, DEFAULT)
    assert found.value == pytest.approx(share, abs=2.0 * found.deviation)
    assert found.deviation < 0.2
    assert (found.log_odds >= DEFAULT.least_actuator_odds) == (share == 1.0)


def test_a_course_beside_which_the_model_runs_out_of_all_bounds_has_no_share(
    quiet_log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, seen = model_in_force(), quiet_log.without("lamp_power")
    days, known = log_days(seen, model), knowledge_of(model, SITE, DEFAULT)
    trial = actuators.with_inputs(days, actuators.courses(seen, days.record, model))
    slopes = np.full((len(known.prior.names), 3, len(days.runs.starts), days.runs.steps), np.nan)
    monkeypatch.setattr(sensitivity, "parameter_sensitivities", lambda *_: slopes)
    with pytest.raises(DivergenceError, match="runs out of all bounds"):
        actuators.share_of_course(days, trial, known, DEFAULT)


@pytest.mark.slow
def test_an_actuator_that_stood_still_is_not_named(dark_log: Log) -> None:
    found = diagnose(dark_log.without("lamp_power"), model_in_force())
    assert "lamp_power" not in {one.effect for one in found.findings}


@pytest.mark.parametrize(("value", "deviation", "odds"), [(1.0, 0.5, 2.0), (0.5, 0.1, 0.0), (0.0, 0.5, -2.0)])
def test_odds_compare_what_the_rules_say_with_standing_still(value: float, deviation: float, odds: float) -> None:
    share = actuators.Share(value, deviation)
    exact = 0.5 * (value / deviation) ** 2 - 0.5 * ((value - 1.0) / deviation) ** 2
    assert share.log_odds == pytest.approx(odds) == pytest.approx(exact)


@pytest.mark.parametrize(
    ("missing", "hiding"),
    [
        ((), False),
        (("vent_wind",), False),
        (("vent_lee", "leaf_area_index"), False),
        (("vent_lee", "vent_wind"), True),
        (("vent_wind", "lamp_power"), True),
        (("energy_screen",), True),
    ],
)
def test_a_greenhouse_with_one_row_of_vents_lacks_no_actuator(missing: tuple[str, ...], *, hiding: bool) -> None:
    assert actuators.may_hide_in_parameters(missing) is hiding
