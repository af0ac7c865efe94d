"""`igrow-trainer import`: what it asks, what it settles by itself, and what it says where a file is no log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.cli import main
from igrow.trainer.data import read_log
from igrow.trainer.data.importing.layout import find_decimal, find_delimiter, find_encoding
from igrow.trainer.data.importing.time_format import find_time
from tests.virtual_log import virtual_log

SITE = "name: westland\nlatitude: 52.0\nlongitude: 4.5\ntime_zone: Europe/Amsterdam\n"
COLUMNS = {
    "Tkas": "air_temperature",
    "RV": "air_humidity",
    "CO2": "air_co2",
    "Tbuiten": "outdoor_temperature",
    "Straling": "global_radiation",
    "Wind snelheid": "wind_speed",
    "Energiedoek": "energy_screen",
}


@pytest.fixture(scope="module")
def truth() -> Telemetry:
    return to_grid(virtual_log(14, seed=9), 1800)


def write(folder: Path, table: Telemetry, zone: str = "Europe/Amsterdam", form: str = "%d-%m-%Y %H:%M") -> Path:
    frame = pd.DataFrame({theirs: table[ours] for theirs, ours in COLUMNS.items()})
    frame.insert(0, "Datum", pd.to_datetime(to_local(table.time, zone)).strftime(form))
    frame.to_csv(folder / "export.csv", sep=";", decimal=",", index=False, float_format="%.2f")
    return folder / "export.csv"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "site.yaml").write_text(SITE)
    return tmp_path / "site.yaml"


def test_an_export_is_read_after_one_command(tmp_path: Path, site: Path, truth: Telemetry, capsys) -> None:
    path = write(tmp_path, truth)
    assert main(["import", str(path), "--site", str(site)]) == 0
    told = capsys.readouterr().out
    assert "672 rows, 2020-02-01 00:00 to 2020-02-14 23:30 UTC, every 30 min" in told
    assert f"next: igrow-trainer calibrate {path} --site {site}" in told
    assert (tmp_path / "export.import.svg").read_text().startswith("<?xml")
    log = read_log(path, site)
    assert log.faults == ()
    assert repr(log) == "Log('export.csv', 2020-02-01 to 2020-02-14 every 30 min, 7 quantities)"
    np.testing.assert_allclose(log.telemetry["air_co2"], truth["air_co2"], atol=0.01)


def test_times_in_utc_are_found_by_the_sun(tmp_path: Path, truth: Telemetry, capsys) -> None:
    site = tmp_path / "site.yaml"
    # As far east as the sun and the clock differ by three hours.
    site.write_text(SITE.replace("4.5", "46.7").replace("Europe/Amsterdam", "Asia/Riyadh"))
    east = Telemetry(truth.time - np.timedelta64(10_128, "s"), truth.columns)
    path = write(tmp_path, to_grid(east, 1800), zone="UTC")
    assert main(["import", str(path), "--site", str(site)]) == 0
    told = capsys.readouterr().out
    assert "set right: times are UTC: noon comes" in told
    assert "time_zone" not in (tmp_path / "export.mapping.yaml").read_text().splitlines()[2]
    assert read_log(path, site).faults == ()


def test_what_only_the_user_knows_is_asked_with_the_option_that_answers(
    tmp_path: Path, truth: Telemetry, capsys
) -> None:
    path = write(tmp_path, truth)
    assert main(["import", str(path)]) == 2
    told = capsys.readouterr()
    assert "open: in which time zone are its times?" in told.out
    assert "answer with --time-zone Europe/Amsterdam" in told.out
    assert "is not written while this is open" in told.err
    assert not (tmp_path / "export.mapping.yaml").exists()
    assert main(["import", str(path), "--time-zone", "Europe/Amsterdam"]) == 0
    assert (read_log(path).telemetry.time == truth.time).all()


def test_a_day_that_may_be_a_month_is_asked_for(tmp_path: Path, truth: Telemetry, capsys) -> None:
    path = write(tmp_path, truth.select(truth.time[2], truth.time[40]))
    assert main(["import", str(path), "--time-zone", "UTC"]) == 2
    assert "--date-order dmy" in capsys.readouterr().out
    assert main(["import", str(path), "--time-zone", "UTC", "--date-order", "mdy"]) == 0
    assert read_log(path).telemetry.time[0].astype("datetime64[D]") == np.datetime64("2020-01-02")


def test_what_is_certain_is_set_right_and_said(tmp_path: Path, site: Path, truth: Telemetry, capsys) -> None:
    odd = truth.with_columns(
        {
            "air_temperature": truth["air_temperature"] * 1.8 + 32.0,
            "outdoor_temperature": truth["outdoor_temperature"] * 1.8 + 32.0,
            "wind_speed": truth["wind_speed"] / 0.44704,
            "air_humidity": truth["air_humidity"] / 100.0,
            "energy_screen": 100.0 - truth["energy_screen"],
            "global_radiation": truth["global_radiation"] * 0.001,
        }
    )
    path = write(tmp_path, odd)
    assert main(["import", str(path), "--site", str(site)]) == 0
    told = capsys.readouterr().out
    assert told.count("set right:") == 6
    log = read_log(path, site)
    assert log.faults == ()
    for name in ("air_temperature", "outdoor_temperature", "wind_speed", "energy_screen"):
        np.testing.assert_allclose(log.telemetry[name], truth[name], atol=0.01)
    np.testing.assert_allclose(log.telemetry["air_humidity"], truth["air_humidity"], atol=0.6)
    np.testing.assert_allclose(log.telemetry["global_radiation"], truth["global_radiation"], atol=5.1)


def test_a_column_may_be_named_and_its_unit_too(tmp_path: Path, truth: Telemetry, capsys) -> None:
    path = write(tmp_path, truth)
    options = ["--time-zone", "Europe/Amsterdam", "--column", "sky_temperature=Tbuiten", "--unit", "wind_speed=km/h"]
    # No column is left for the outdoor temperature: that is open now.
    assert main(["import", str(path), *options]) == 2
    table = read_log(path).telemetry
    assert "sky_temperature" in table
    np.testing.assert_allclose(table["wind_speed"], truth["wind_speed"] / 3.6, atol=0.01)
    for wrong, message in (
        (["--column", "air_temprature=Tkas"], "did you mean air_temperature"),
        (["--column", "air_temperature=Tkass"], "no such column: did you mean Tkas"),
        (["--unit", "wind_speed=furlong"], "is never in 'furlong'"),
        (["--column", "air_temperature"], "QUANTITY=... is needed"),
    ):
        assert main(["import", str(path), "--force", *options[:2], *wrong]) == 2
        assert message in capsys.readouterr().err


def test_a_mapping_that_is_there_is_not_replaced_unasked(tmp_path: Path, site: Path, truth: Telemetry, capsys) -> None:
    path = write(tmp_path, truth)
    (tmp_path / "export.mapping.yaml").write_text("columns: {}\n")
    assert main(["import", str(path), "--site", str(site)]) == 2
    assert "--force replaces it" in capsys.readouterr().err
    assert main(["import", str(path), "--site", str(site), "--dry-run"]) == 0
    assert (tmp_path / "export.mapping.yaml").read_text() == "columns: {}\n"
    assert main(["import", str(path), "--site", str(site), "--force"]) == 0
    assert "air_temperature" in (tmp_path / "export.mapping.yaml").read_text()


def test_a_folder_of_exports_shares_one_mapping(tmp_path: Path, truth: Telemetry) -> None:
    folder = tmp_path / "exports"
    folder.mkdir()
    half = truth.time[300]
    write(folder, truth.select(None, half)).rename(folder / "january.csv")
    write(folder, truth.select(half, None)).rename(folder / "february.csv")
    assert main(["import", str(folder), "--time-zone", "Europe/Amsterdam"]) == 0
    assert (folder / "mapping.yaml").exists()
    assert len(read_log(folder).telemetry) == len(truth)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no row has a time and numbers"),
        ("just words\nand more of them\n", "no row has a time and numbers"),
        ("a,b\n1,2\n3,4\n", "no row has a time and numbers"),
        ("t,T,RH\n2020-01-01 00:00,20,5,80,1\n2020-01-01 00:05,20,6,80,2\n", "5 cells where the header has 3"),
        ("2020-01-01 00:00,20\n2020-01-01 00:05,21\n", "no line names the columns"),
    ],
)
def test_what_is_no_log_is_refused_in_one_line(tmp_path: Path, capsys, text: str, message: str) -> None:
    (tmp_path / "export.csv").write_text(text)
    assert main(["import", str(tmp_path / "export.csv")]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1


@pytest.mark.parametrize("name", ["export.xlsx", "export.parquet", "export.csv.gz"])
def test_a_file_that_is_not_what_its_name_says_is_refused_in_one_line(tmp_path: Path, capsys, name: str) -> None:
    (tmp_path / name).write_bytes(b"\x1f\x8b\x00rubbish" if name.endswith("gz") else b"rubbish")
    assert main(["import", str(tmp_path / name)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_parquet_file_may_have_its_times_in_the_index_and_in_a_column(tmp_path: Path, capsys) -> None:
    time = pd.date_range("2020-02-01", periods=500, freq="5min", tz="UTC")
    warmth = {"Air temperature (C)": 20.0 + np.sin(np.arange(500.0)), "Outside temperature (C)": np.arange(500.0) % 9}
    pd.DataFrame({"time": time, **warmth}, index=time.tz_localize(None)).to_parquet(tmp_path / "export.parquet")
    assert main(["import", str(tmp_path / "export.parquet")]) == 0
    assert "air_temperature         Air temperature (C)" in capsys.readouterr().out


def test_every_error_about_a_log_names_the_command(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("Datum;Tkas\n01-02-2020 00:00;20,1\n")
    with pytest.raises(IgrowError, match=r"`igrow-trainer import .*log.csv` finds out how it is to be read"):
        read_log(tmp_path / "log.csv")
    pd.DataFrame({"t": [1]}).to_excel(tmp_path / "log.xlsx", index=False)
    with pytest.raises(IgrowError, match=r"a workbook needs a mapping \(`igrow-trainer import"):
        read_log(tmp_path / "log.xlsx")


@pytest.mark.parametrize(
    "stamp", ["2020-02-01 00:00:00+00:00", "2020-02-01T01:00:00+01:00", "2020-02-01T00:00Z", "20200201T000000.000Z"]
)
def test_every_iso_time_with_a_zone_is_read(tmp_path: Path, stamp: str) -> None:
    rows = f"time,air_temperature\n{stamp},20\n{stamp.replace('02-01', '02-02').replace('0201T', '0202T')},21\n"
    (tmp_path / "log.csv").write_text(rows)
    assert read_log(tmp_path / "log.csv").telemetry.time[0] == np.datetime64("2020-02-01T00:00:00")


@pytest.mark.parametrize(
    ("first", "second", "form"),
    [
        ("2020-02-01T00:00:00", "2020-02-01T00:05:00", "ISO 8601"),
        ("2020-02-01 00:00:00+00:00", "2020-02-01 00:05:00+00:00", "ISO 8601"),
        ("13-02-2020 00:00", "13-02-2020 00:05", "%d-%m-%Y %H:%M"),
        ("13.2.20 0:00:00", "13.2.20 0:05:00", "%d.%m.%y %H:%M:%S"),
        ("2/13/2020 12:00 AM", "2/13/2020 12:05 AM", "%m/%d/%Y %I:%M %p"),
        ("2/13/2020 12:00 a.m.", "2/13/2020 12:05 a.m.", "%m/%d/%Y %I:%M %p"),
        ("2020/02/13 00:00", "2020/02/13 00:05", "%Y/%m/%d %H:%M"),
        ("2020年02月13日 00:00", "2020年02月13日 00:05", "%Y年%m月%d日 %H:%M"),
        ("20200213 0000", "20200213 0005", "ISO 8601"),
        ("02132020 0000", "02132020 0005", None),
        ("13-mrt-2020 00:00", "13-mrt-2020 00:05", "%d-%b-%Y %H:%M"),
        ("13. März 2020 00:00", "13. März 2020 00:05", "%d. %b %Y %H:%M"),
        ("43890.25", "43890.253472", "excel"),
        ("1580515200", "1580515500", "unix"),
        ("1580515200000", "1580515500000", "unix ms"),
    ],
)
def test_forms_of_time_are_told(first: str, second: str, form: str | None) -> None:
    found = find_time({"when": [first, second]})
    assert (found.form if found else None) == form


def test_the_hour_24_is_the_next_midnight(tmp_path: Path) -> None:
    (tmp_path / "e.csv").write_text("t;T\n31-01-2020 23:00;20\n31-01-2020 24:00;21\n01-02-2020 01:00;22\n")
    (tmp_path / "e.mapping.yaml").write_text(
        'time: {column: t, format: "%d-%m-%Y %H:%M"}\ndelimiter: ";"\ncolumns: {air_temperature: {column: T}}\n'
    )
    assert read_log(tmp_path / "e.csv").telemetry["air_temperature"].tolist() == [20.0, 21.0, 22.0]


def test_delimiter_decimal_and_encoding_are_told() -> None:
    assert find_delimiter("a;b;c\n1,5;2,5;3\n1,5;2,5;3\n") == ";"
    assert find_delimiter("a,b,c\n1.5,2.5,3\n") == ","
    assert find_delimiter("a\tb\n1,5\t2\n") == "\t"
    assert find_delimiter("sep=|\na|b\n1|2\n") == "|"
    assert find_decimal([["1,5", "20", "3,25"]]) == ","
    assert find_decimal([["1.5", "1,234.5"]]) == "."
    assert find_encoding("Außen;ö".encode("cp1252") * 50) == "cp1252"
    assert find_encoding("室外温度".encode("gb18030") * 50) == "gb18030"
    assert find_encoding("a;b".encode("utf-16")) == "utf-16"
