"""Further habits of exports: each reads as the truth, or is refused in one line that says what would be right."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.cli import main
from igrow.trainer.data import read_log
from igrow.trainer.data.fixed_places import split, stands_at_fixed_places
from igrow.trainer.data.importing.error_codes import error_codes
from igrow.trainer.data.importing.time_format import find_time
from igrow.trainer.data.number_texts import number
from tests.data.test_exports_of_elsewhere import AMSTERDAM, PLAIN, assert_reads_as, imported, moved, written
from tests.virtual_log import virtual_log

pytestmark = pytest.mark.usefixtures("without_picture")
TERSE = ("Time", "AirTemp_C", "RH_%", "CO2_ppm", "OutsideTemp_C", "Radiation_W/m2", "Wind_speed")


@pytest.fixture(scope="module")
def log() -> Telemetry:
    """A fortnight of a mild winter, every half hour."""
    return to_grid(virtual_log(14, seed=9), 1800)


def local(log: Telemetry) -> pd.DatetimeIndex:
    return pd.DatetimeIndex(to_local(log.time, AMSTERDAM))


def long(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.melt(id_vars="Time", var_name="Sensor", value_name="Value").sort_values("Time", kind="stable")


def transposed(log: Telemetry) -> str:
    return str(written(log, PLAIN).set_index("Time").T.to_csv(sep=";", decimal=","))


def transposed_below_a_title(log: Telemetry) -> str:
    return f"Climate report;week 5\n{transposed(log)}"


def transposed_with_units(log: Telemetry) -> str:
    frame = written(log, PLAIN).set_index("Time").T
    frame.insert(0, "Unit", [name.split("(")[1][:-1] for name in frame.index])
    frame.index = pd.Index([name.split(" (")[0] for name in frame.index], name="Variable")
    return str(frame.to_csv())


def fixed_places(log: Telemetry) -> str:
    return str(written(log, TERSE, "%Y-%m-%dT%H:%M").to_string(index=False))


def fixed_places_with_blanks_in_names(log: Telemetry) -> str:
    return str(written(log, PLAIN, "%d-%m-%Y %H:%M").to_string(index=False))


def codes_of_quality_before_the_readings(log: Telemetry) -> str:
    frame = long(written(log, PLAIN))
    frame.insert(1, "Quality", 192)
    return str(frame.to_csv(index=False))


def many_columns_beside_the_readings(log: Telemetry) -> str:
    frame = long(written(log, PLAIN))
    frame = frame.assign(Id=range(len(frame)), Min=frame["Value"] - 1.0, Max=frame["Value"] + 1.0, Site="W", Device=7)
    return str(frame[["Id", "Time", "Device", "Site", "Min", "Max", "Sensor", "Value"]].to_csv(index=False))


def columns_that_change_places(log: Telemetry) -> str:
    frame = written(log, PLAIN)
    other = frame.iloc[200:][[PLAIN[0], PLAIN[2], PLAIN[1], *PLAIN[3:]]]
    return str(frame.iloc[:200].to_csv(index=False) + other.to_csv(index=False))


def a_line_that_looks_like_a_reading(log: Telemetry) -> str:
    head = "Exported;2020-02-20 12:00;by;3\nChannels;12;rows;672\n"
    return str(head + written(log, PLAIN, "%Y-%m-%d %H:%M").to_csv(sep=";", decimal=",", index=False))


def means_of_days(log: Telemetry) -> str:
    frame = written(log, PLAIN, "%d-%m-%Y %H:%M")
    parts = []
    for day, rows in frame.groupby(local(log).date):
        means = [f"{day:%d-%m-%Y}", *rows.iloc[:, 1:].mean().round(2)]
        parts += [rows, pd.DataFrame([means], columns=frame.columns)]
    return str(pd.concat(parts).to_csv(index=False))


def every_line_in_quotes(log: Telemetry) -> str:
    lines = written(log, PLAIN).to_csv(index=False).splitlines()
    return "\n".join(f'"{line}"' for line in lines)


def spanish_months(log: Telemetry) -> str:
    names = ["enero", "febrero", "marzo"]
    times = [f"{t.day} de {names[t.month - 1]} de {t.year} {t:%H:%M}" for t in local(log)]
    return str(written(log, PLAIN).assign(Time=times).to_csv(index=False, sep=";"))


def days_of_the_year(log: Telemetry) -> str:
    return str(written(log, PLAIN, "%Y-%j %H:%M").to_csv(index=False))


def minus_behind(log: Telemetry) -> str:
    frame = written(log, PLAIN).astype(object)
    frame[PLAIN[4]] = [f"{-value:.3f}-" if value < 0 else f"{value:.3f}" for value in log["outdoor_temperature"]]
    return str(frame.to_csv(index=False))


def no_number_of_other_programs(log: Telemetry) -> str:
    frame = written(log, PLAIN).astype(object)
    frame.iloc[100, 1:] = "1.#QNAN"
    return str(frame.to_csv(index=False))


@pytest.mark.parametrize(
    "habit",
    [
        transposed, transposed_below_a_title, transposed_with_units, fixed_places, fixed_places_with_blanks_in_names,
        codes_of_quality_before_the_readings, many_columns_beside_the_readings, columns_that_change_places,
        a_line_that_looks_like_a_reading, means_of_days, every_line_in_quotes, spanish_months, days_of_the_year,
        minus_behind, no_number_of_other_programs,
    ],
)  # fmt: skip
def test_a_habit_is_read(tmp_path: Path, log: Telemetry, habit: Callable[[Telemetry], str]) -> None:
    cold = log.with_columns({"outdoor_temperature": log["outdoor_temperature"] - 8.0})
    (tmp_path / "export.csv").write_text(habit(cold))
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, cold)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_is_read_without_a_mark_of_its_order(tmp_path: Path, log: Telemetry, encoding: str) -> None:
    written(log, PLAIN).to_csv(tmp_path / "export.csv", sep="\t", index=False, encoding=encoding)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def test_a_workbook_with_the_times_across_is_read(tmp_path: Path, log: Telemetry) -> None:
    frame = written(log, PLAIN).set_index("Time").T
    frame.columns = local(log)
    frame.to_excel(tmp_path / "export.xlsx")
    assert imported(tmp_path, export="export.xlsx") == 0
    assert_reads_as(tmp_path, log, export="export.xlsx")


def workbook(path: Path, sheets: Mapping[str, pd.DataFrame]) -> None:
    with pd.ExcelWriter(path) as book:
        for name, frame in sheets.items():
            frame.to_excel(book, sheet_name=name, index=False)


def test_the_days_of_a_workbook_with_a_sheet_each_are_joined(tmp_path: Path, log: Telemetry, capsys) -> None:
    """One day was read, and the others named alone."""
    frame = written(log, PLAIN)
    legend = pd.DataFrame({"legend": ["T", "RH"], "meaning": ["temperature", "humidity"]})
    # A day's sheet ends with the midnight that the next one begins with.
    days = {f"day {day + 1}": frame.iloc[48 * day : 48 * (day + 1) + 1] for day in range(14)}
    workbook(tmp_path / "export.xlsx", {"legend": legend, **days})
    assert imported(tmp_path, "--date-order", "dmy", export="export.xlsx") == 0
    told = capsys.readouterr().out
    assert "14 sheets, 'day 1' to 'day 14'" in told
    assert "have readings too" not in told
    assert_reads_as(tmp_path, log, export="export.xlsx")
    # A sheet that is added later is read too.
    assert "sheet" not in (tmp_path / "export.mapping.yaml").read_text().partition("\n")[2]


def test_of_workbooks_with_a_sheet_a_month_in_a_folder_all_are_read(tmp_path: Path, log: Telemetry) -> None:
    frame, folder = written(log, PLAIN), tmp_path / "years"
    folder.mkdir()
    for year, rows in (("2019", frame.iloc[:336]), ("2020", frame.iloc[336:])):
        workbook(folder / f"{year}.xlsx", {f"week {year}": rows.iloc[:240], f"rest of {year}": rows.iloc[240:]})
    assert imported(tmp_path, "--date-order", "dmy", export="years") == 0
    assert_reads_as(tmp_path, log, export="years")


@pytest.mark.parametrize("kind", ["compartments", "columns"])
def test_sheets_of_the_same_times_or_of_other_columns_are_named_and_not_joined(
    tmp_path: Path, log: Telemetry, capsys, kind: str
) -> None:
    frame = written(log, PLAIN)
    other = {
        "compartments": {"Afd 1": frame, "Afd 2": frame.iloc[:-10]},
        "columns": {"Afd 1": frame.iloc[:400], "Afd 2": frame.iloc[400:, :-1]},
    }[kind]
    workbook(tmp_path / "export.xlsx", other)
    imported(tmp_path, "--date-order", "dmy", export="export.xlsx")
    told = capsys.readouterr().out
    assert "note: sheet 'Afd 1' alone is read; 'Afd 2' have readings too, in other columns or of the same times" in told
    assert len(read_log(tmp_path / "export.xlsx").telemetry) == len(other["Afd 1"])
    imported(tmp_path, "--date-order", "dmy", "--sheet", "Afd 2", "--force", export="export.xlsx")
    assert "alone is read" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("am", "pm", "form"),
    [
        ("a.\u00a0m.", "p.\u00a0m.", "{} {}"), ("vorm.", "nachm.", "{} {}"), ("VM", "NM", "{} {}"),
        ("上午", "下午", "{1} {0}"), ("午前", "午後", "{1}{0}"), ("오전", "오후", "{1} {0}"), ("πμ", "μμ", "{} {}"),
        ("da manhã", "da tarde", "{} {}"),
        ("AM", "PM", "{1} {0}"), ("fm", "em", "{1} {0}"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("columns", [1, 2])
def test_the_halves_of_the_day_are_read_in_other_languages(
    tmp_path: Path, log: Telemetry, am: str, pm: str, form: str, columns: int
) -> None:
    """A column of `01:30 nachm.` was taken for one of compartments."""
    frame, when = written(log, PLAIN).drop(columns="Time"), local(log)
    hours = [form.format(f"{one:%I:%M}", am if one.hour < 12 else pm) for one in when]
    if columns == 2:
        frame.insert(0, "Hour", hours)
        frame.insert(0, "Date", when.strftime("%d-%m-%Y"))
    else:
        frame.insert(0, "Time", [f"{day} {hour}" for day, hour in zip(when.strftime("%d-%m-%Y"), hours, strict=True)])
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path, "--date-order", "dmy") == 0
    assert_reads_as(tmp_path, log)


def test_a_clock_from_0_to_11_has_its_noon(tmp_path: Path, log: Telemetry) -> None:
    frame, when = written(log, PLAIN), local(log)
    frame["Time"] = [f"{one:%Y/%m/%d} {('午前', '午後')[one.hour >= 12]}{one.hour % 12}:{one:%M}" for one in when]
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def test_times_of_day_with_a_word_that_nobody_knows_are_named(tmp_path: Path, log: Telemetry, capsys) -> None:
    frame, when = written(log, PLAIN).drop(columns="Time"), local(log)
    frame.insert(0, "Hour", [f"{one:%I:%M} {('asubuhi', 'jioni')[one.hour >= 12]}" for one in when])
    frame.insert(0, "Date", when.strftime("%d-%m-%Y"))
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    assert "'Hour' has times of day with a word that is not known, such as '01:00 asubuhi'" in capsys.readouterr().err


def test_of_a_reading_that_is_missing_at_fixed_places_no_other_moves(tmp_path: Path, log: Telemetry) -> None:
    frame = written(log, TERSE, "%Y-%m-%dT%H:%M").astype(object)
    frame.iloc[100:110, 3] = ""
    (tmp_path / "export.txt").write_text(frame.to_string(index=False))
    assert imported(tmp_path, export="export.txt") == 0
    read = read_log(tmp_path / "export.txt").telemetry
    assert np.isnan(read["air_co2"]).sum() == 10
    np.testing.assert_allclose(read["outdoor_temperature"], log["outdoor_temperature"], atol=0.06)


def test_what_stands_at_fixed_places_is_told_from_other_texts() -> None:
    text = "Time              Air temp   RH\n01-02-2020 00:30      20,5   80\n01-02-2020 01:00       9,5  100\n"
    assert stands_at_fixed_places(text)
    assert [cell.strip() for cell in split(text)[0][0]] == ["Time", "", "Air temp", "RH"]
    assert not stands_at_fixed_places("Time;T;RH\n01-02-2020 00:30;1 020,5;80\n01-02-2020 01:00;1 021,5;80\n")
    assert not stands_at_fixed_places("Time,T,RH\n01-02-2020 00:30,1 020.5,80 1\n01-02-2020 01:00,1 021.5,80 2\n")


def test_units_that_change_from_file_to_file_are_those_of_each(tmp_path: Path, log: Telemetry) -> None:
    """The names stay, and the line of units below them turns from degC to degF."""
    folder = tmp_path / "export"
    folder.mkdir()
    names = (*(name.split(" (")[0] for name in PLAIN[:-1]), "Wind speed")
    frame = written(log, names)
    american = frame.iloc[200:].copy()
    for column in ("Air temp", "Outside temp"):
        american[column] = american[column] * 1.8 + 32.0
    for name, part, unit in (("1.csv", frame.iloc[:200], "C"), ("2.csv", american, "F")):
        units = f",{unit},%,ppm,{unit},W/m2,m/s\n"
        (folder / name).write_text(",".join(names) + "\n" + units + part.to_csv(index=False, header=False))
    assert imported(tmp_path, export="export") == 0
    assert_reads_as(tmp_path, log, export="export")


@pytest.mark.parametrize("code", ["9999", "-999", "65535", "999.9", "85.0"])
def test_a_number_for_a_fault_is_no_reading(tmp_path: Path, log: Telemetry, capsys, code: str) -> None:
    """A few rows of it made the wind km/h, four times over, and the sun no sun."""
    frame = written(log, PLAIN).astype(object)
    chosen = np.random.default_rng(1).choice(len(frame), (6, 9), replace=False)
    for column, rows in enumerate(chosen, 1):
        if code not in {"999.9", "85.0"} or PLAIN[column].startswith(("Air", "Outside", "Wind")):
            frame.iloc[rows, column] = code
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    told = capsys.readouterr().out
    assert f"taken for no reading: '{code}'" in told
    assert "set right" not in told
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml")
    assert read.faults == ()
    for name in ("wind_speed", "air_temperature", "outdoor_temperature"):
        there = np.isfinite(read.telemetry[name])
        assert there.sum() == len(log) - 9
        np.testing.assert_allclose(read.telemetry[name][there], log[name][there], atol=0.01)


def test_what_lies_among_the_readings_is_no_code() -> None:
    steady = [f"{value:.1f}" for value in np.linspace(0.0, 9.0, 91)]
    assert error_codes([*steady, "60", "60", "60"], ".") == ("60",)
    assert error_codes([*steady, "60", "60", "-99", "-99", "-99", "60"], ".") == ("-99", "60")
    assert error_codes([*steady, "60"], ".") == ()
    assert error_codes([*steady, "12.0", "12.0", "12.0"], ".") == ()
    assert error_codes(["0", "100"] * 50, ".") == ()


def test_a_remedy_that_does_not_cure_is_not_taken_twice(tmp_path: Path, log: Telemetry, capsys) -> None:
    """Gusts that are as high in km/h are no wind in any unit."""
    frame = written(log, PLAIN)
    frame["Wind (m/s)"] = np.round(np.linspace(300.0, 400.0, len(frame)), 2)
    frame.rename(columns={"Wind (m/s)": "Wind speed"}).to_csv(tmp_path / "export.csv", index=False)
    imported(tmp_path)
    told = capsys.readouterr().out
    assert told.count("taken for km/h (--unit") == 1
    assert "data fault: wind_speed" in told


def test_tenths_of_the_air_are_tenths_of_the_weather_too(tmp_path: Path, log: Telemetry, capsys) -> None:
    """An outdoor temperature of 88 in tenths was taken for degF, twice."""
    frame = written(log, (*(name.split(" (")[0] for name in PLAIN[:-1]), "Wind speed"))
    for column in ("Air temp", "Outside temp"):
        frame[column] = (frame[column] * 10.0).round().astype(int)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert (
        "'Outside temp' has no unit: taken for tenths of degC, as those of the greenhouse are"
        in capsys.readouterr().out
    )
    assert_reads_as(tmp_path, log)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("Humidity (g/kg)", "g/kg"), ("Radiation (kcal/m2/h)", "kcal/m2/h"), ("CO2 dosing (l/min)", "l/min")],
)
def test_a_unit_that_is_not_known_is_said_and_not_taken_for_ours(
    tmp_path: Path, log: Telemetry, capsys, name: str, unit: str
) -> None:
    frame = written(log, PLAIN)
    frame[name] = np.round(3.0 + np.sin(np.arange(len(frame))), 3)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert f"note: {name!r} is in {unit!r}, which is not known: left out" in capsys.readouterr().out
    assert_reads_as(tmp_path, log)
    assert "co2_dosing" not in read_log(tmp_path / "export.csv").telemetry


@pytest.mark.parametrize(("unit", "factor"), [("MJ/m2/h", 0.0036), ("cal/cm2/min", 1.0 / 697.33)])
def test_further_units_of_the_sun_are_known(tmp_path: Path, log: Telemetry, unit: str, factor: float) -> None:
    frame = written(log, PLAIN).rename(columns={PLAIN[5]: f"Radiation ({unit})"})
    frame[f"Radiation ({unit})"] = log["global_radiation"] * factor
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def _houses(log: Telemetry) -> Iterator[tuple[str, pd.DataFrame]]:
    for house, warmer in (("1", 3.0), ("2", 0.0)):
        frame = written(log, PLAIN)
        for column in PLAIN[1:4]:
            frame[column] += warmer
        yield house, frame


@pytest.mark.parametrize("called", ["Compartment", "Logger"])
def test_houses_in_a_long_table_are_never_mixed(tmp_path: Path, log: Telemetry, capsys, called: str) -> None:
    """The later house won, or its number was read for the temperature."""
    parts = [long(frame).assign(**{called: house}) for house, frame in _houses(log)]
    pd.concat(parts)[["Time", called, "Sensor", "Value"]].to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    assert "which compartment is the log of? (1, 2)" in capsys.readouterr().out
    assert imported(tmp_path, "--compartment", "2") == 0
    assert_reads_as(tmp_path, log)


def test_readings_of_one_sensor_that_contradict_each_other_are_a_fault(tmp_path: Path, log: Telemetry) -> None:
    """A mapping by hand that names no house."""
    pd.concat([long(frame) for _, frame in _houses(log)]).to_csv(tmp_path / "export.csv", index=False)
    (tmp_path / "export.mapping.yaml").write_text(
        'time: {column: "Time", format: "%d/%m/%Y %H:%M"}\nlong: {name: "Sensor", value: "Value"}\n'
        'columns: {air_temperature: {column: "Air temp (C)"}}\n'
    )
    assert [fault.kind for fault in read_log(tmp_path / "export.csv").faults] == ["repeated_times"]


def test_files_of_two_houses_in_one_folder_are_a_fault(tmp_path: Path, log: Telemetry, capsys) -> None:
    (tmp_path / "export").mkdir()
    for house, frame in _houses(log):
        frame.to_csv(tmp_path / "export" / f"house{house}.csv", index=False)
    imported(tmp_path, export="export")
    assert "several files have rows of the same times, and their air_temperature differs by" in capsys.readouterr().out
    read = read_log(tmp_path / "export", tmp_path / "site.yaml")
    assert [fault.kind for fault in read.faults] == ["repeated_times"]


def test_files_that_overlap_and_agree_are_no_fault(tmp_path: Path, log: Telemetry) -> None:
    (tmp_path / "export").mkdir()
    frame = written(log, PLAIN)
    for name, rows in (("1.csv", frame.iloc[:300]), ("2.csv", frame.iloc[200:])):
        rows.to_csv(tmp_path / "export" / name, index=False)
    assert imported(tmp_path, export="export") == 0
    assert_reads_as(tmp_path, log, export="export")


def _halves(log: Telemetry) -> str:
    frame = written(log, PLAIN, "%I:%M")
    frame.insert(1, "AM/PM", local(log).strftime("%p"))
    frame.insert(0, "Date", local(log).strftime("%m/%d/%Y"))
    return str(frame.to_csv(index=False))


def _day_of_year(log: Telemetry) -> str:
    frame = written(log, PLAIN).drop(columns="Time")
    times = local(log)
    frame.insert(0, "Year", times.year)
    frame.insert(1, "DOY", times.day_of_year)
    frame.insert(2, "HHMM", 100 * times.hour + times.minute)
    return str(frame.to_csv(index=False))


def _hours_across(log: Telemetry) -> str:
    times = local(log)
    frame = pd.DataFrame({"Day": times.date, "hour": times.strftime("%H:%M"), "value": log["air_temperature"].round(2)})
    return str(frame.pivot_table(index="Day", columns="hour", values="value").to_csv())


def _another_column(log: Telemetry) -> str:
    frame = written(log, PLAIN)
    wider = frame.iloc[200:].assign(**{"Vent lee (%)": 5})
    return str(frame.iloc[:200].to_csv(index=False) + wider.to_csv(index=False))


def _without_date(log: Telemetry) -> str:
    return str(written(log, PLAIN, "%H:%M").to_csv(index=False))


def _without_year(log: Telemetry) -> str:
    return str(written(log, PLAIN, "%d-%m %H:%M").to_csv(index=False))


def _json(log: Telemetry) -> str:
    buffer = io.StringIO()
    written(log, PLAIN).to_json(buffer, orient="records", lines=True)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("habit", "told"),
    [
        (_halves, "its time stands in 3 columns (Date, Time, AM/PM): join them in one, such as 2020-02-01 13:30"),
        (_day_of_year, "its time stands in 3 columns (Year, DOY, HHMM): join them in one"),
        (_hours_across, "the hours of a day stand across (00:00, 00:30, 01:00, ...): export a row for each time"),
        (_another_column, ":202: columns change here: this line names them anew and has 'Vent lee (%)' too"),
        (_without_date, "its times, such as '01:00', have no date: put the date in a column of its own"),
        (_without_year, "its times, such as '01-02 01:00', have no year: write it in, such as 2020-02-01 13:30"),
        (_json, "is JSON: a table is needed, such as CSV with a row for each time and a column for each sensor"),
    ],
)
def test_what_cannot_be_read_is_told_exactly(
    tmp_path: Path, log: Telemetry, capsys, habit: Callable[[Telemetry], str], told: str
) -> None:
    (tmp_path / "export.csv").write_text(habit(log))
    assert imported(tmp_path) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "export.mapping.yaml").exists()


def test_french_months_are_read_with_their_points_and_without(tmp_path: Path, log: Telemetry) -> None:
    spring = moved(log, "2020-02-24")
    names = {2: "févr.", 3: "mars"}
    times = [f"{t.day} {names[t.month]} {t.year} {t.hour:02}h{t.minute:02}" for t in local(spring)]
    written(spring, PLAIN).assign(Time=times).to_csv(tmp_path / "export.csv", index=False, encoding="cp1252")
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, spring)


@pytest.mark.parametrize(
    ("first", "second", "form"),
    [
        ("1580515200000000", "1580515500000000", "unix us"),
        ("1580515200000000000", "1580515500000000000", "unix ns"),
        ("2020-032T00:30", "2020-032T01:00", "%Y-%jT%H:%M"),
        ("1 févr. 2020 00h00", "1 mars 2020 00h30", "%d %b %Y %Hh%M"),
        ("1 de febrero de 2020 00:00", "1 de marzo de 2020 00:00", "%d %b %Y %H:%M"),
    ],
)
def test_further_forms_of_time_are_told(first: str, second: str, form: str) -> None:
    found = find_time({"when": [first, second]})
    assert found is not None
    assert found.form == form


@pytest.mark.parametrize(
    ("text", "value"), [("4,5-", -4.5), ("1.234,5 -", -1234.5), ("1.#QNAN", None), ("-1.#IND", None), ("20 #", None)]
)
def test_numbers_are_read_whole_or_not_at_all(text: str, value: float | None) -> None:
    assert number(text, ",") == value


def test_a_mapping_with_the_times_across_may_be_written_by_hand(tmp_path: Path) -> None:
    (tmp_path / "export.csv").write_text("name,2020-02-01 00:00,2020-02-01 00:30\nTkas,20,21\n")
    (tmp_path / "export.mapping.yaml").write_text(
        "transposed: true\ntime: {column: name}\ncolumns: {air_temperature: {column: Tkas}}\n"
    )
    assert read_log(tmp_path / "export.csv").telemetry["air_temperature"].tolist() == [20.0, 21.0]
    assert main(["import", str(tmp_path / "export.csv"), "--dry-run"]) == 2
