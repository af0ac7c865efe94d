"""`evaluate`: a bundle on a log that it has not seen, beside persistence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from igrow.core.bundle import Bundle, EffectRecord, Estimate, Span
from igrow.core.errors import IgrowError
from igrow.core.local_time import utc_datetime
from igrow.core.telemetry import Telemetry, write_csv
from igrow.trainer import FittedModel, export, prepare_log
from igrow.trainer.cli import main
from igrow.trainer.scoring.bundles import ACTUATORS, BY_SETPOINTS, score_bundle, unseen_part
from tests.virtual_log import GREENHOUSE, SITE, virtual_log

DAYS = 12
JUDGED_TOO = ("air_humidity", "air_co2")
SITE_FILE = "name: virtual\nlatitude: 52.0\nlongitude: 4.5\n"


@pytest.fixture(scope="module")
def telemetry() -> Telemetry:
    return virtual_log(DAYS, seed=3, step=900.0)


@pytest.fixture(scope="module")
def truth() -> FittedModel:
    """The very simulator that made the log."""
    described = FittedModel.described(SITE)
    known = described.posterior.moved(np.array([GREENHOUSE[name] for name in described.posterior.names]))
    return replace(described, posterior=known, alignment=0.0, calibrated_on=SITE.name)


@pytest.fixture(scope="module")
def bundle(truth: FittedModel, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return export(truth, tmp_path_factory.mktemp("truth") / "bundle")


@pytest.mark.slow
def test_the_true_model_has_no_error_but_noise_and_plans_come_close(telemetry: Telemetry, bundle: Bundle) -> None:
    found = score_bundle(prepare_log(telemetry, SITE), bundle)
    assert set(found) == {ACTUATORS, BY_SETPOINTS}
    for quantity, noise in (("air_temperature", 0.05), ("air_humidity", 0.4), ("air_co2", 5.0)):
        for horizon in ("1_h", "24_h", "7_d"):
            # What is left is the noise of the reading that it is compared with, and of the one that it starts from.
            assert found[ACTUATORS][quantity][horizon].mae < 2.0 * noise, (quantity, horizon)
            assert found[BY_SETPOINTS][quantity][horizon].runs == found[ACTUATORS][quantity][horizon].runs
    day = found[BY_SETPOINTS]["air_temperature"]["24_h"]
    assert day.mae_low < day.mae < day.mae_high
    # A plan holds its setpoints; the computer that made the log keeps them within a proportional band.
    assert day.mae < 0.8


def test_effects_of_the_bundle_are_active(telemetry: Telemetry, truth: FittedModel, tmp_path: Path) -> None:
    offset = EffectRecord("air_temperature_offset", "sensor", {"offset": Estimate(2.0, 1.9, 2.1, "K")})
    wrong = export(replace(truth, effects=(offset,)), tmp_path / "wrong")
    right = telemetry.with_columns({"air_temperature": telemetry["air_temperature"] + 2.0})
    assert score_bundle(prepare_log(right, SITE), wrong, ("24_h",))[ACTUATORS]["air_temperature"]["24_h"].mae < 0.1


@pytest.mark.slow
def test_days_that_the_bundle_was_calibrated_on_are_left_out(
    telemetry: Telemetry, truth: FittedModel, tmp_path: Path
) -> None:
    log = prepare_log(telemetry, SITE)
    span = Span(*(utc_datetime(telemetry.time[row]) for row in (0, 5 * 96)))
    bundle = export(replace(truth, training_span=span), tmp_path / "bundle")
    rest = unseen_part(log, bundle.manifest)
    assert rest.telemetry.time[0] == telemetry.time[5 * 96 + 1]
    assert "left out" in rest.notes[-1]
    with pytest.raises(IgrowError, match="all days of this log are among them"):
        score_bundle(log.select(None, telemetry.time[4 * 96]), bundle)
    elsewhere = export(replace(truth, training_span=span, calibrated_on="elsewhere"), tmp_path / "elsewhere")
    assert unseen_part(log, elsewhere.manifest) is log


@pytest.mark.slow
def test_a_diagnosis_leaves_out_the_days_that_its_bundle_was_calibrated_on(
    telemetry: Telemetry, truth: FittedModel, tmp_path: Path
) -> None:
    span = Span(*(utc_datetime(telemetry.time[row]) for row in (0, 4 * 96)))
    bundle = export(replace(truth, training_span=span), tmp_path / "bundle").folder
    (tmp_path / "site.yaml").write_text(SITE_FILE)

    given = ["--site", str(tmp_path / "site.yaml"), "--bundle", str(bundle), "--out", str(tmp_path / "out")]
    # Of the temperature alone a diagnosis takes a third of the time.
    write_csv(tmp_path / "log.csv", telemetry.only([name for name in telemetry.columns if name not in JUDGED_TOO]))
    assert main(["diagnose", str(tmp_path / "log.csv"), *given]) in {0, 10, 11, 12}
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert told["span"]["start"] == f"{telemetry.time[4 * 96 + 1]}Z"
    assert "they are left out" in (tmp_path / "out" / "report.html").read_text()


def test_the_command_prints_a_table_and_writes_it(
    telemetry: Telemetry, bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_csv(tmp_path / "log.csv", telemetry.select(None, telemetry.time[4 * 96]))
    (tmp_path / "site.yaml").write_text(SITE_FILE)
    given = [str(tmp_path / "log.csv"), "--site", str(tmp_path / "site.yaml"), "--bundle", str(bundle.folder)]
    assert main(["evaluate", *given, "--out", str(tmp_path / "errors.json")]) == 0
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("persistence", "by actuators", "by setpoints", "air_co2", "24_h"))
    assert all(line.endswith("  K") for line in shown.splitlines() if line.startswith("air_temperature"))
    assert "7_d" not in shown, "four days hold no run of a week"
    written = json.loads((tmp_path / "errors.json").read_text())
    assert written["by actuators"]["air_temperature"]["24_h"]["mae"] < 0.2


def test_a_log_without_a_complete_run_is_refused_in_one_line(
    telemetry: Telemetry, bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    holes = np.where(np.arange(len(telemetry)) % 8 < 6, np.nan, telemetry["outdoor_temperature"])
    write_csv(tmp_path / "log.csv", telemetry.with_columns({"outdoor_temperature": holes}))
    (tmp_path / "site.yaml").write_text(SITE_FILE)
    given = [str(tmp_path / "log.csv"), "--site", str(tmp_path / "site.yaml"), "--bundle", str(bundle.folder)]
    assert main(["evaluate", *given]) == 2
    assert "Traceback" not in capsys.readouterr().err
