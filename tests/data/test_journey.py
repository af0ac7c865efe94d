"""From an export to a report, as docs/data.md has it typed; and what is said of a log that is no good."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry, to_grid, write_csv
from igrow.trainer.cli import main
from tests.virtual_log import virtual_log

SITE = "name: westland\nlatitude: 52.0\nlongitude: 4.5\ntime_zone: Europe/Amsterdam\n"
NAMES = {
    "Kastemperatuur [°C]": "air_temperature",
    "RV kas [%]": "air_humidity",
    "CO2 [ppm]": "air_co2",
    "Buitentemperatuur [°C]": "outdoor_temperature",
    "Straling [W/m2]": "global_radiation",
    "Windsnelheid [m/s]": "wind_speed",
    "Energiedoek [%]": "energy_screen",
    "Raam luwe zijde [%]": "vent_lee",
    "Buis [°C]": "rail_pipe_temperature",
    "CO2 dosering [kg/m2/h]": "co2_dosing",
    "Lampen [W/m2]": "lamp_power",
}


@pytest.fixture(scope="module")
def log() -> Telemetry:
    return to_grid(virtual_log(12, seed=3), 3600)


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "site.yaml").write_text(SITE)
    return tmp_path / "site.yaml"


def test_three_commands_lead_from_an_export_to_a_report(tmp_path: Path, site: Path, log: Telemetry, capsys) -> None:
    frame = pd.DataFrame({theirs: log[ours] for theirs, ours in NAMES.items()})
    frame.insert(0, "Datum", pd.to_datetime(to_local(log.time, "Europe/Amsterdam")).strftime("%d-%m-%Y %H:%M"))
    export, bundle, out = tmp_path / "export.csv", tmp_path / "bundle", tmp_path / "diagnosis"
    frame.to_csv(export, sep=";", decimal=",", index=False, float_format="%.5f", encoding="cp1252")
    assert main(["import", str(export), "--site", str(site)]) == 0
    assert "data fault" not in capsys.readouterr().out
    known = ["--site", str(site)]
    assert main(["calibrate", str(export), *known, "--fit-weeks", "4", "--out", str(bundle)]) == 0
    found = main(["diagnose", str(export), *known, "--bundle", str(bundle), "--out", str(out), "--language", "nl"])
    assert found in {0, 10, 11, 12}
    assert '<html lang="nl">' in (out / "report.html").read_text()
    assert json.loads((out / "diagnosis.json").read_text())["verdict"] != "data_fault"


def test_the_commands_are_those_of_the_documentation() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "data.md").read_text()
    typed = [line.split()[:2] for line in text.split("```")[1].splitlines() if line]
    assert typed == [["igrow-trainer", name] for name in ("import", "calibrate", "diagnose")]


@pytest.mark.parametrize(
    ("spoilt", "mend"),
    [
        ("fahrenheit", "so it is in degF: in the mapping: air_temperature"),
        ("daily", "too sparse for any model: export a row every hour or more"),
        ("clock", "give the time zone of the export"),
    ],
)
def test_a_log_that_is_no_good_is_a_data_fault_with_its_mend(
    tmp_path: Path, site: Path, log: Telemetry, capsys, spoilt: str, mend: str
) -> None:
    table = {
        "fahrenheit": log.with_columns({"air_temperature": log["air_temperature"] * 1.8 + 32.0}),
        "daily": to_grid(log, 86_400),
        "clock": Telemetry(log.time + np.timedelta64(5, "h"), log.columns),
    }[spoilt]
    write_csv(tmp_path / "log.csv", table)
    out = tmp_path / "diagnosis"
    assert main(["diagnose", str(tmp_path / "log.csv"), "--site", str(site), "--out", str(out)]) == 13
    assert mend in capsys.readouterr().out
    told = json.loads((out / "diagnosis.json").read_text())
    assert (told["verdict"], told["findings"]) == ("data_fault", [])
    assert main(["calibrate", str(tmp_path / "log.csv"), "--site", str(site), "--out", str(tmp_path / "bundle")]) == 2
    assert mend in capsys.readouterr().err
