from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis import Diagnosis, Evidence, diagnose
from igrow.trainer.report import render_report
from tests.diagnosis.conftest import deployed_model
from tests.virtual_log import SITE


@pytest.fixture(scope="module")
def leak(leaky_log: Telemetry) -> tuple[Diagnosis, Evidence | None]:
    return diagnose(leaky_log, SITE, deployed_model())


def test_nothing_is_claimed_where_nothing_is_missing(quiet_log: Telemetry) -> None:
    diagnosis, _ = diagnose(quiet_log, SITE, deployed_model())
    assert diagnosis.verdict == "nothing"
    assert diagnosis.findings == ()
    assert diagnosis.exit_code == 0


def test_a_leak_is_named_with_its_size_and_its_errors_before_and_after(
    leak: tuple[Diagnosis, Evidence | None],
) -> None:
    diagnosis, _ = leak
    assert diagnosis.findings[0].effect == "wind_infiltration"
    assert diagnosis.exit_code in {10, 11}
    day = diagnosis.errors["air_temperature"]["24_h"]
    assert day["corrected"] < day["deployed"]
    size = diagnosis.findings[0].parameters["air_changes"]
    assert size.low < size.value < size.high
    assert 0.04 < size.value < 0.3


def test_the_document_has_the_fields_that_are_promised(leak: tuple[Diagnosis, Evidence | None]) -> None:
    document = json.loads(json.dumps(leak[0].to_json(), allow_nan=False))
    assert set(document) == {"verdict", "span", "findings", "errors", "screened"}
    assert set(document["span"]) == {"start", "end", "fit_days", "held_out_days"}
    finding = document["findings"][0]
    assert set(finding) == {
        "effect", "kind", "balances", "parameters", "onset", "p_value", "rivals", "drivers", "separating_test",
    }  # fmt: skip
    assert set(finding["parameters"]["air_changes"]) == {"value", "low", "high", "unit"}
    assert finding["effect"] in finding["rivals"]
    for horizons in document["errors"].values():
        assert set(horizons) <= {"1_step", "24_h", "7_d"}
        assert set(horizons["24_h"]) == {"deployed", "recalibrated", "corrected", "unit"}


def test_the_report_is_one_page_that_fetches_nothing(leak: tuple[Diagnosis, Evidence | None]) -> None:
    page = render_report(*leak, deployed_model())
    assert "ore air leaks in when the wind blows" in page
    assert "<svg" in page
    assert not re.search(r'(src|href)="https?:', page)


def test_an_effect_that_is_taken_out_is_not_named(leaky_log: Telemetry) -> None:
    diagnosis, _ = diagnose(leaky_log, SITE, deployed_model(), without=["wind_infiltration"])
    assert "wind_infiltration" not in [one.effect for one in diagnosis.findings]


def test_a_cause_outside_the_catalogue_is_told_by_its_hours_and_not_given_a_name(door_log: Telemetry) -> None:
    diagnosis, evidence = diagnose(door_log, SITE, deployed_model())
    assert diagnosis.verdict == "unexplained"
    remainder = diagnosis.findings[-1]
    assert remainder.kind == "remainder"
    assert {"hour", "weekday"} <= set(remainder.drivers)
    assert evidence is not None
    assert evidence.corrected.remainder
    day = diagnosis.errors["air_co2"]["24_h"]
    assert day["corrected"] < day["recalibrated"]


def test_a_log_without_humidity_and_co2_is_diagnosed_on_what_it_has(quiet_log: Telemetry) -> None:
    kept = {name: values for name, values in quiet_log.columns.items() if name not in {"air_humidity", "air_co2"}}
    diagnosis, _ = diagnose(Telemetry(quiet_log.time, kept), SITE, deployed_model())
    assert set(diagnosis.errors) == {"air_temperature"}
    assert "co2_offset" in diagnosis.untestable


def test_lamps_whose_power_the_log_lacks_are_traced_to_their_switch(quiet_log: Telemetry) -> None:
    kept = {name: values for name, values in quiet_log.columns.items() if name != "lamp_power"}
    diagnosis, _ = diagnose(Telemetry(quiet_log.time, kept), SITE, deployed_model())
    assert diagnosis.verdict == "unexplained"
    assert "lamp_on" in diagnosis.findings[-1].drivers
    day = diagnosis.errors["air_temperature"]["24_h"]
    assert day["corrected"] < 0.7 * day["recalibrated"]


def test_co2_is_left_out_where_its_dose_is_not_known(quiet_log: Telemetry) -> None:
    kept = {name: values for name, values in quiet_log.columns.items() if name != "co2_dosing"}
    undosed = replace(SITE, greenhouse=replace(SITE.greenhouse, co2_dosing_capacity=0.0))
    for site, quantities in (
        (SITE, {"air_temperature", "air_humidity"}),
        (undosed, {"air_temperature", "air_humidity", "air_co2"}),
    ):
        diagnosis, _ = diagnose(Telemetry(quiet_log.time, kept), site, deployed_model())
        assert set(diagnosis.errors) == quantities
    assert "co2_offset" not in diagnosis.untestable


def test_a_gap_of_two_days_is_lived_with(quiet_log: Telemetry) -> None:
    inside = (np.arange(len(quiet_log)) > 600) & (np.arange(len(quiet_log)) < 800)
    holed = {name: np.where(inside, np.nan, values) for name, values in quiet_log.columns.items()}
    diagnosis, _ = diagnose(Telemetry(quiet_log.time, holed), SITE, deployed_model())
    assert diagnosis.verdict == "nothing"


def test_a_stuck_sensor_is_a_data_fault(quiet_log: Telemetry) -> None:
    stuck = np.array(quiet_log["air_temperature"])
    stuck[300:] = 19.5
    diagnosis, evidence = diagnose(quiet_log.with_columns({"air_temperature": stuck}), SITE, deployed_model())
    assert diagnosis.verdict == "data_fault"
    assert diagnosis.exit_code == 13
    assert evidence is None
    assert any(one.quantity == "air_temperature" and one.reason == "stuck" for one in diagnosis.screened)


def test_a_log_of_three_days_is_refused_in_one_line(quiet_log: Telemetry) -> None:
    short = quiet_log.select(None, quiet_log.time[0] + np.timedelta64(3, "D"))
    with pytest.raises(IgrowError, match="at least 7"):
        diagnose(short, SITE, deployed_model())


def test_a_log_without_outdoor_temperature_is_refused(quiet_log: Telemetry) -> None:
    kept = {name: values for name, values in quiet_log.columns.items() if name != "outdoor_temperature"}
    with pytest.raises(IgrowError, match="no outdoor_temperature"):
        diagnose(Telemetry(quiet_log.time, kept), SITE, deployed_model())
