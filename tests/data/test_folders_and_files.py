"""Folders of exports, and files that are something else than their names say."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import read_log
from tests.data.test_exports_of_elsewhere import EXPECTED, PLAIN, assert_reads_as, imported, written
from tests.virtual_log import virtual_log

pytestmark = pytest.mark.usefixtures("without_picture")


@pytest.fixture(scope="module")
def log() -> Telemetry:
    return to_grid(virtual_log(14, seed=9), 1800)


def test_a_file_for_each_day_is_read_as_one_log(tmp_path: Path, log: Telemetry, capsys) -> None:
    """The first of February alone does not tell day from month, nor does one day tell anything of the sun."""
    (tmp_path / "log").mkdir()
    frame = written(log, PLAIN, "%d-%m-%Y %H:%M")
    for day, part in frame.groupby(frame["Time"].str[:10]):
        part.to_csv(tmp_path / "log" / f"{day[6:]}{day[3:5]}{day[:2]}.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    assert "672 rows, 2020-02-01 00:00 to 2020-02-14 23:30 UTC" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "log").glob("*.yaml")] == ["mapping.yaml"]
    assert_reads_as(tmp_path, log, "log")


def test_a_file_for_each_sensor_has_a_mapping_of_its_own(tmp_path: Path, log: Telemetry, capsys) -> None:
    (tmp_path / "log").mkdir()
    frame = written(log, PLAIN, "%Y-%m-%d %H:%M:%S")
    for late, (name, ours) in enumerate(zip(PLAIN[1:], EXPECTED, strict=True)):
        stamps = pd.to_datetime(frame["Time"]) + pd.Timedelta(seconds=17 * late)
        frame[[name]].assign(Time=stamps).to_csv(tmp_path / "log" / f"{ours}.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    told = capsys.readouterr().out
    assert "open:" not in told
    assert len(list((tmp_path / "log").glob("*.mapping.yaml"))) == len(EXPECTED)
    assert_reads_as(tmp_path, log, "log")


def test_a_text_with_tabs_may_be_called_a_workbook(tmp_path: Path, log: Telemetry) -> None:
    written(log, PLAIN).to_csv(tmp_path / "export.xls", sep="\t", decimal=",", index=False, encoding="utf-16")
    assert imported(tmp_path, export="export.xls") == 0
    assert_reads_as(tmp_path, log, "export.xls")


def test_what_is_no_table_is_named(tmp_path: Path, capsys) -> None:
    with zipfile.ZipFile(tmp_path / "archive.csv", "w") as archive:
        archive.writestr("log.csv", "Time,T\n")
    (tmp_path / "export.xls").write_text("<html><table><tr><td>1</td></tr></table></html>")
    (tmp_path / "export.csv").write_bytes(b"%PDF-1.7 ...")
    for name, message in (
        ("archive.csv", "is a zip archive or a workbook: let its name end in .zip or .xlsx"),
        ("export.xls", "is a page of HTML or XML: open it in a spreadsheet and save it as CSV or .xlsx"),
        ("export.csv", "is a PDF: a table is needed"),
    ):
        assert imported(tmp_path, export=name) == 2
        told = capsys.readouterr().err
        assert message in told
        assert told.count("\n") == 1


def test_the_rows_of_a_file_of_a_folder_are_named_by_that_file(tmp_path: Path, log: Telemetry, capsys) -> None:
    (tmp_path / "log").mkdir()
    frame = written(log, PLAIN).astype(str)
    frame[:300].to_csv(tmp_path / "log" / "a.csv", index=False)
    frame[300:].to_csv(tmp_path / "log" / "b.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    frame.loc[400:409, "Time"] = "not 1 time"
    frame[300:].to_csv(tmp_path / "log" / "b.csv", index=False)
    assert imported(tmp_path, "--force", export="log") == 2
    assert "b.csv:102: 'not 1 time' is no time of the form %d/%m/%Y %H:%M" in capsys.readouterr().err
    frame.loc[400:500, "Time"] = "not 1 time"
    frame[300:].to_csv(tmp_path / "log" / "b.csv", index=False)
    assert imported(tmp_path, "--force", export="log") == 2
    assert "'Time' begins with '01/02/2020 01:00', but has 'not 1 time' too" in capsys.readouterr().err


def test_a_folder_read_by_its_files_mappings_is_the_same_as_by_one(tmp_path: Path, log: Telemetry) -> None:
    (tmp_path / "log").mkdir()
    frame = written(log, PLAIN)
    frame[:300].to_csv(tmp_path / "log" / "a.csv", index=False)
    frame[300:].rename(columns={"RH (%)": "Humidity (%)"}).to_csv(tmp_path / "log" / "b.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    table = read_log(tmp_path / "log").telemetry
    np.testing.assert_allclose(table["air_humidity"], log["air_humidity"], atol=0.01)
