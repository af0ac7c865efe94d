"""An actuator that the log lacks: traced to what is withheld, by name, with the course that the rules gave it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.simulator.hybrid.nominal import site_record
from igrow.trainer.data import Log
from igrow.trainer.diagnosis import DEFAULT, Diagnosis, actuators, diagnose
from igrow.trainer.diagnosis.diagnose import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from tests.diagnosis.conftest import model_in_force
from tests.virtual_log import SITE


@pytest.fixture(scope="module")
def unlit(quiet_log: Log) -> Diagnosis:
    return diagnose(quiet_log.without("lamp_power"), model_in_force())


def test_lamps_that_the_log_lacks_are_named_as_such(unlit: Diagnosis, quiet_log: Log) -> None:
    found = unlit.findings[0]
    assert (found.effect, found.kind) == ("lamp_power", "actuator")
    assert unlit.verdict == "named"
    assert found.parameters["share"].low < 1.0 < found.parameters["share"].high
    assert "The log lacks the lamp power" in found.sentence
    # The log lacks it nevertheless, and no effect goes into the corrected model for it.
    assert "lamp_power" in unlit.missing
    assert unlit.corrected.effects == ()


def test_errors_are_those_of_the_log_as_it_is_until_the_correction(unlit: Diagnosis, quiet_log: Log) -> None:
    whole = diagnose(quiet_log, model_in_force()).errors["air_temperature"]["24_h"]
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
    done = actuators.complete(quiet_log, days, model, known, DEFAULT, np.random.default_rng(0))
    assert done == actuators.Completed(days, (), None)


def test_a_log_lacks_only_what_the_site_has(quiet_log: Log) -> None:
    bare = quiet_log.without("grow_pipe_temperature", "lamp_power").telemetry
    house = SITE.greenhouse
    without = replace(SITE, greenhouse=replace(house, grow_pipe_heat_transfer=0.0, lamps=None))
    assert {"grow_pipe_temperature", "lamp_power"} <= set(site_record(bare, SITE, 900.0).missing)
    assert not {"grow_pipe_temperature", "lamp_power"} & set(site_record(bare, without, 900.0).missing)
