"""A grower's own export, read through its mapping."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry
from igrow.core.yaml_schema import SchemaError, load, parse
from igrow.trainer.data.export import read
from igrow.trainer.data.mapping import ExportMapping

DUTCH = """
delimiter: ";"
decimal: ","
missing: ["-"]
time: {column: Datum, format: "%d-%m-%Y %H:%M", time_zone: Europe/Amsterdam}
columns:
  air_temperature: {column: Tkas}
  lamp_power: {column: HPS, scale: 81, add: [LED]}
"""


def export(tmp_path: Path, text: str, mapping: str) -> Telemetry:
    (tmp_path / "export.csv").write_text(text)
    return read(tmp_path / "export.csv", parse(mapping, ExportMapping)).telemetry


def test_a_dutch_export_is_read_with_its_own_names_signs_and_zone(tmp_path: Path) -> None:
    text = "Datum;Tkas;HPS;LED;Rest\n15-01-2020 12:00;21,5;1;0,5;x\n15-07-2020 12:00;-;0;0;y\n"
    telemetry = export(tmp_path, text, DUTCH)
    np.testing.assert_array_equal(telemetry.time, np.array(["2020-01-15T11:00", "2020-07-15T10:00"], "datetime64[s]"))
    np.testing.assert_array_equal(telemetry["air_temperature"], [21.5, np.nan])
    np.testing.assert_array_equal(telemetry["lamp_power"], [121.5, 0.0])


def test_dots_between_thousands_are_no_decimals_where_commas_are(tmp_path: Path) -> None:
    telemetry = export(tmp_path, "Datum;Tkas;HPS;LED\n15-01-2020 12:00;20;1.000,5;1\n", DUTCH)
    np.testing.assert_array_equal(telemetry["lamp_power"], [81.0 * 1001.5])


def test_serial_days_are_rounded_to_the_second(tmp_path: Path) -> None:
    mapping = "time: {column: t, format: excel}\ncolumns: {air_co2: {column: CO2}}\n"
    telemetry = export(tmp_path, "t,CO2\n43816.0000000001,500\n43816.00347222,600\n", mapping)
    np.testing.assert_array_equal(telemetry.time, np.array(["2019-12-17T00:00", "2019-12-17T00:05"], "datetime64[s]"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Datum;Tkass;HPS;LED\n", "no column 'Tkas'; it has Datum, Tkass"),
        ("Datum;Tkas;HPS\n", "no column 'LED'"),
        ("Datum;Tkas;HPS;LED\n2020-01-15;1;1;1\n", ":2: '2020-01-15' is no time of the form %d-%m-%Y"),
        ("Datum;Tkas;HPS;LED\n15-01-2020 12:00;warm;1;1\n", ":2: Tkas is 'warm'"),
    ],
)
def test_an_export_that_does_not_fit_its_mapping_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(IgrowError) as caught:
        export(tmp_path, text, DUTCH)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time: {column: t}\ncolumns:\n  air_temprature: {column: T}\n", r"mapping.yaml:3:3: .*air_temperature"),
        ('decimal: "x"\ncolumns: {}\n', "decimal is 'x'"),
        ('delimiter: ";;"\ncolumns: {}\n', "one character is needed"),
    ],
)
def test_a_mapping_that_means_nothing_is_refused_with_its_place(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mapping.yaml"
    path.write_text(text)
    with pytest.raises(SchemaError, match=message):
        load(path, ExportMapping)


def test_quoted_decimal_commas_between_commas_are_read(tmp_path: Path) -> None:
    mapping = 'decimal: ","\ntime: {column: t, time_zone: UTC}\ncolumns: {air_temperature: {column: T}}\n'
    telemetry = export(tmp_path, 't,T\n2020-01-01 00:00,"21,5"\n2020-01-01 00:05,"1.021,5"\n', mapping)
    assert telemetry["air_temperature"].tolist() == [21.5, 1021.5]


def test_a_row_with_more_cells_than_names_is_refused_with_its_line(tmp_path: Path) -> None:
    mapping = "time: {column: t}\ncolumns: {air_temperature: {column: T}}\n"
    with pytest.raises(IgrowError, match=r"export.csv:3: 3 cells where the header has 2"):
        export(tmp_path, "t,T\n2020-01-01T00:00Z,20\n2020-01-01T00:05Z,20,5\n", mapping)


def test_columns_of_one_name_are_told_apart(tmp_path: Path) -> None:
    mapping = 'time: {column: t}\ncolumns: {air_temperature: {column: T}, outdoor_temperature: {column: "T (2)"}}\n'
    telemetry = export(tmp_path, "t,T,T\n2020-01-01T00:00Z,20,5\n", mapping)
    assert (telemetry["air_temperature"][0], telemetry["outdoor_temperature"][0]) == (20.0, 5.0)


@pytest.mark.parametrize("order", ["forwards", "backwards", "one reading a row"])
def test_the_hour_that_happens_twice_is_told_by_the_order_of_rows(tmp_path: Path, order: str) -> None:
    hours = np.datetime64("2020-10-25T00:00:00") + np.arange(8) * np.timedelta64(30, "m")
    wall = ["02:00", "02:30", "02:00", "02:30", "03:00", "03:30", "04:00", "04:30"]
    rows = [f"2020-10-25 {hour},{value}" for value, hour in enumerate(wall)]
    columns = "columns: {air_temperature: {column: T}}\n"
    header = "t,T"
    if order == "backwards":
        rows = rows[::-1]
    if order == "one reading a row":
        header, columns = "t,T,tag", "long: {name: tag, value: T}\ncolumns: {air_temperature: {column: a}}\n"
        rows = [f"{row},{tag}" for row in rows for tag in ("a", "b")]
    text = "\n".join([header, *rows]) + "\n"
    telemetry = export(tmp_path, text, "time: {column: t, time_zone: Europe/Amsterdam}\n" + columns)
    np.testing.assert_array_equal(telemetry.time, hours)
    assert telemetry["air_temperature"].tolist() == list(range(8))
