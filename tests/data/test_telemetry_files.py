"""Telemetry in files and folders, and growers' own exports."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry, write_csv
from igrow.trainer.data.open_source import open_source

MAPPING = """
time: {column: Tijd, format: "%d-%m-%Y %H:%M", time_zone: Europe/Amsterdam}
delimiter: ";"
columns:
  air_temperature: {column: "Temp kas"}
  energy_screen: {column: Doek, scale: -1, offset: 100}
"""


def table(first: str, count: int, value: float) -> Telemetry:
    time = np.datetime64(first, "s") + np.arange(count) * np.timedelta64(300, "s")
    return Telemetry(time, {"air_temperature": np.full(count, value), "outdoor_temperature": np.full(count, 5.0)})


def test_a_folder_of_day_segments_is_one_log_in_time(tmp_path: Path) -> None:
    write_csv(tmp_path / "2020-01-02.csv.gz", table("2020-01-02T00:00:00", 3, 21.0))
    write_csv(tmp_path / "2020-01-01.csv", table("2020-01-01T00:00:00", 3, 20.0))
    log = open_source(tmp_path)
    assert log.telemetry["air_temperature"].tolist() == [20.0] * 3 + [21.0] * 3


def test_parquet_is_read_like_csv(tmp_path: Path) -> None:
    one = table("2020-01-01T00:00:00", 4, 20.0)
    frame = pd.DataFrame({"time": one.time, **one.columns})
    frame.to_parquet(tmp_path / "log.parquet")
    read = open_source(tmp_path / "log.parquet").telemetry
    assert (read.time == one.time).all()
    assert read["air_temperature"].tolist() == [20.0] * 4


def test_a_column_of_parquet_that_is_no_quantity_is_refused(tmp_path: Path) -> None:
    pd.DataFrame({"time": [pd.Timestamp("2020-01-01")], "Tair": [20.0]}).to_parquet(tmp_path / "log.parquet")
    with pytest.raises(IgrowError, match="Tair is no known quantity"):
        open_source(tmp_path / "log.parquet")


def test_a_growers_export_is_read_by_its_mapping(tmp_path: Path) -> None:
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    (tmp_path / "export.csv").write_text(
        "Tijd;Temp kas;Doek;Iets\n01-07-2020 12:00;21.5;30;x\n01-07-2020 12:05;-;0;y\n"
    )
    read = open_source(tmp_path).telemetry
    assert read.time[0] == np.datetime64("2020-07-01T10:00:00")
    assert read["energy_screen"].tolist() == [70.0, 100.0]
    assert np.isnan(read["air_temperature"][1])


def test_an_error_in_an_export_tells_its_place(tmp_path: Path) -> None:
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    export = tmp_path / "export.csv"
    export.write_text("Tijd;Temp kas;Doek\n2020/07/01;21.5;30\n")
    with pytest.raises(IgrowError, match=r"export.csv:2: '2020/07/01' is no time of the form"):
        open_source(tmp_path)
    export.write_text("Tijd;Kas;Doek\n01-07-2020 12:00;21.5;30\n")
    with pytest.raises(IgrowError, match="no column 'Temp kas'; it has Tijd, Kas, Doek"):
        open_source(tmp_path)


def test_an_unknown_quantity_in_a_mapping_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "mapping.yaml").write_text("columns:\n  air_temprature: {column: T}\n")
    (tmp_path / "export.csv").write_text("time,T\n")
    with pytest.raises(IgrowError, match=r"mapping.yaml:2:3: .*air_temperature"):
        open_source(tmp_path)


def test_a_folder_without_telemetry_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="no telemetry in it"):
        open_source(tmp_path)
