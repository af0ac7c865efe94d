"""Tables with times of day alone, whose day stands in the name of their file or sheet; and archives in archives."""

from __future__ import annotations

import io
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import read_log
from igrow.trainer.data.named_days import day_in
from tests.data.test_exports_of_elsewhere import EXPECTED, PLAIN, assert_reads_as, imported, written
from tests.virtual_log import virtual_log

pytestmark = pytest.mark.usefixtures("without_picture")


@pytest.fixture(scope="module")
def log() -> Telemetry:
    """Return two weeks whose days begin at midnight in Amsterdam."""
    return to_grid(virtual_log(15, seed=9), 1800).select(
        np.datetime64("2020-02-01T23:00"), np.datetime64("2020-02-14T23:00")
    )


def days(log: Telemetry, clock: str = "%H:%M") -> Iterator[tuple[pd.Timestamp, pd.DataFrame]]:
    """Yield each day with its rows, whose times are those of the day alone."""
    frame = written(log, PLAIN, "%Y-%m-%d %H:%M")
    stamps = pd.to_datetime(frame["Time"])
    for day, rows in frame.groupby(stamps.dt.normalize()):
        yield day, rows.assign(Time=stamps[rows.index].dt.strftime(clock))


@pytest.mark.parametrize(
    ("name", "day"),
    [
        ("2020-02-01.csv", "2020-02-01"),
        ("log_20200201.csv.gz", "2020-02-01"),
        ("log_20200201_0000.csv", "2020-02-01"),
        ("20200201000500.csv", "2020-02-01"),
        ("kas 1 01-02-2020.csv", "01-02-2020"),
        ("01022020.csv", "01-02-2020"),
        ("1.2.20", "1-2-20"),
        ("1 de febrero de 2020.xlsx", "1 Feb 2020"),
        ("Feb 1, 2020", "Feb 1 2020"),
        ("2020-02-01 2020-02-02.csv", None),
        ("01-02.csv", None),
        ("Sheet1", None),
        ("sensor 1580515200.csv", None),
    ],
)
def test_a_day_is_found_in_a_name(name: str, day: str | None) -> None:
    assert day_in(name) == day


@pytest.mark.parametrize("clock", ["%H:%M", "%I:%M %p"])
def test_files_with_times_of_day_have_the_day_of_their_names(
    tmp_path: Path, log: Telemetry, capsys, clock: str
) -> None:
    (tmp_path / "log").mkdir()
    for day, rows in days(log, clock):
        rows.to_csv(tmp_path / "log" / f"house 1 {day:%d-%m-%Y}.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    assert "624 rows, 2020-02-01 23:00 to 2020-02-14 22:30 UTC" in capsys.readouterr().out
    assert_reads_as(tmp_path, log, "log")


def test_the_midnight_that_ends_a_day_is_no_beginning(tmp_path: Path, log: Telemetry) -> None:
    (tmp_path / "log").mkdir()
    ended = Telemetry(log.time + np.timedelta64(30, "m"), log.columns)
    for (day, _), (_, rows) in zip(days(log), _of_day_before(ended), strict=True):
        rows.to_csv(tmp_path / "log" / f"{day:%Y%m%d}.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    assert_reads_as(tmp_path, ended, "log")


def _of_day_before(log: Telemetry) -> Iterator[tuple[pd.Timestamp, pd.DataFrame]]:
    """Yield the rows of days that begin after midnight and end with the next one."""
    frame = written(log, PLAIN, "%Y-%m-%d %H:%M")
    stamps = pd.to_datetime(frame["Time"])
    for day, rows in frame.groupby((stamps - pd.Timedelta(minutes=1)).dt.normalize()):
        yield day, rows.assign(Time=stamps[rows.index].dt.strftime("%H:%M"))


def test_sheets_with_times_of_day_have_the_day_of_their_names(tmp_path: Path, log: Telemetry, capsys) -> None:
    with pd.ExcelWriter(tmp_path / "export.xlsx") as book:
        for day, rows in days(log):
            rows.to_excel(book, sheet_name=f"{day.day} febrero {day.year}", index=False)
    assert imported(tmp_path, export="export.xlsx") == 0
    assert "13 sheets, '2 febrero 2020' to '14 febrero 2020'" in capsys.readouterr().out
    assert_reads_as(tmp_path, log, "export.xlsx")


def test_times_of_day_without_a_day_and_rows_of_two_days_are_told_with_their_mend(
    tmp_path: Path, log: Telemetry, capsys
) -> None:
    parts = dict(days(log))
    first, second = list(parts.values())[:2]
    first.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    assert "or name the file after its day, such as 2020-02-01" in capsys.readouterr().err
    pd.concat([first, second]).to_csv(tmp_path / "2020-02-02.csv", index=False)
    assert imported(tmp_path, export="2020-02-02.csv") == 2
    told = capsys.readouterr().err
    assert (
        "2020-02-02.csv:50: another day begins, and the name tells 2020-02-02 alone: put the date in a column" in told
    )
    assert told.count("\n") == 1


def test_a_file_that_comes_later_without_a_day_in_its_name_is_told(tmp_path: Path, log: Telemetry) -> None:
    (tmp_path / "log").mkdir()
    for day, rows in days(log):
        rows.to_csv(tmp_path / "log" / f"{day:%Y-%m-%d}.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    (tmp_path / "log" / "2020-02-14.csv").rename(tmp_path / "log" / "last.csv")
    with pytest.raises(Exception, match=r"last\.csv: its times have no date: .* name the file after its day"):
        read_log(tmp_path / "log")


def test_archives_in_an_archive_are_unpacked_too(tmp_path: Path, log: Telemetry) -> None:
    frame = written(log, PLAIN)
    with zipfile.ZipFile(tmp_path / "export.zip", "w") as outer:
        for week in range(2):
            held = io.BytesIO()
            with zipfile.ZipFile(held, "w") as inner:
                inner.writestr("log.csv", frame[312 * week : 312 * (week + 1)].to_csv(index=False))
            outer.writestr(f"weeks/week {week}.zip", held.getvalue())
    assert imported(tmp_path, export="export.zip") == 0
    assert (tmp_path / "export" / "weeks" / "week 1" / "log.csv").is_file()
    assert_reads_as(tmp_path, log, "export.zip")


def test_an_archive_that_holds_itself_for_ever_ends(tmp_path: Path, capsys) -> None:
    content = b""
    for _ in range(6):
        held = io.BytesIO()
        with zipfile.ZipFile(held, "w") as archive:
            archive.writestr("more.zip", content)
        content = held.getvalue()
    (tmp_path / "export.zip").write_bytes(content)
    assert imported(tmp_path, export="export.zip") == 2
    told = capsys.readouterr().err
    assert "no table in it (CSV, Excel or Parquet): it holds more.zip" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("name", ["export.7z", "export.rar", "export.csv", "export.tar.gz"])
def test_an_archive_of_another_kind_is_told_as_one(tmp_path: Path, log: Telemetry, capsys, name: str) -> None:
    content = (
        b"Rar!\x1a\x07\x01\x00" + bytes(range(256))
        if name != "export.7z"
        else b"7z\xbc\xaf\x27\x1c\x00\x04" + bytes(99)
    )
    (tmp_path / name).write_bytes(content)
    if name == "export.tar.gz":
        written(log, PLAIN).to_csv(tmp_path / "log.csv", index=False)
        with tarfile.open(tmp_path / name, "w:gz") as archive:
            archive.add(tmp_path / "log.csv", "log.csv")
    assert imported(tmp_path, export=name) == 2
    told = capsys.readouterr().err
    assert f"{name}: is an archive that is not read: unpack it, and give the folder" in told
    assert told.count("\n") == 1


def test_a_growers_weather_file_makes_no_folder_a_public_data_set(tmp_path: Path, log: Telemetry) -> None:
    """Two exports of one greenhouse at paces of their own are one log, whatever they are called."""
    (tmp_path / "log").mkdir()
    frame = written(log, PLAIN)
    outside = [name for name, ours in zip(PLAIN[1:], EXPECTED, strict=True) if ours.startswith(("out", "glob", "wind"))]
    frame.drop(columns=outside).to_csv(tmp_path / "log" / "climate.csv", index=False)
    frame[["Time", *outside]][::2].to_csv(tmp_path / "log" / "meteo.csv", index=False)
    assert imported(tmp_path, export="log") == 0
    table = read_log(tmp_path / "log").telemetry
    np.testing.assert_allclose(table["air_temperature"], log["air_temperature"], atol=0.01)
    np.testing.assert_allclose(table["outdoor_temperature"][::2], log["outdoor_temperature"][::2], atol=0.01)
    assert np.isfinite(table["outdoor_temperature"][:-1]).all()
