"""Exports of other languages, units and habits: each reads as the truth, or nothing is written and it is said why."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core import sun
from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.cli import main
from igrow.trainer.data import read_log
from tests.virtual_log import virtual_log

pytestmark = pytest.mark.usefixtures("without_picture")
AMSTERDAM = "Europe/Amsterdam"
EXPECTED = ("air_temperature", "air_humidity", "air_co2", "outdoor_temperature", "global_radiation", "wind_speed")
Frame = tuple[pd.DataFrame, dict[str, object]]


@pytest.fixture(scope="module")
def log() -> Telemetry:
    """A fortnight of a mild winter, every half hour; as cold as where degF are written, so that 30 is no degC."""
    table = to_grid(virtual_log(14, seed=9), 1800)
    return table.with_columns({"outdoor_temperature": table["outdoor_temperature"] - 10.0})


def degrees_fahrenheit(values: np.ndarray) -> np.ndarray:
    return values * 1.8 + 32.0


def written(log: Telemetry, names: Sequence[str], form: str = "%d/%m/%Y %H:%M", zone: str = AMSTERDAM) -> pd.DataFrame:
    """The time and six columns, called as `names` say."""
    frame = pd.DataFrame({name: log[ours] for name, ours in zip(names[1:], EXPECTED, strict=True)}).round(3)
    frame.insert(0, names[0], pd.DatetimeIndex(to_local(log.time, zone)).strftime(form))
    return frame


def imported(folder: Path, *options: str, zone: str = AMSTERDAM, export: str = "export.csv") -> int:
    (folder / "site.yaml").write_text(f"name: westland\nlatitude: 52.0\nlongitude: 4.5\ntime_zone: {zone}\n")
    return main(["import", str(folder / export), "--site", str(folder / "site.yaml"), *options])


def assert_reads_as(folder: Path, log: Telemetry, export: str = "export.csv", near: float = 0.06) -> None:
    read = read_log(folder / export, folder / "site.yaml")
    assert read.faults == ()
    table = read.telemetry
    assert table.time[0] == log.time[0]
    for name in EXPECTED:
        far = {"air_co2": 0.6, "global_radiation": 2.0}.get(name, near)
        there = np.isfinite(table[name])
        assert there.sum() >= len(log) - 2, name
        np.testing.assert_allclose(table[name][there], log[name][there], atol=far, err_msg=name)


LANGUAGES = {
    "fr": (
        "cp1252", "Date/heure", "Température intérieure (°C)", "Humidité relative (%)", "Concentration CO2 (ppm)",
        "Température extérieure (°C)", "Rayonnement global (W/m²)", "Vitesse du vent (m/s)",
    ),
    "pl": (
        "cp1250", "Data i godzina", "Temperatura wewnętrzna [°C]", "Wilgotność względna [%]", "Stężenie CO2 [ppm]",
        "Temperatura zewnętrzna [°C]", "Promieniowanie słoneczne [W/m2]", "Prędkość wiatru [m/s]",
    ),
    "it": (
        "cp1252", "Data e ora", "Temperatura interna", "Umidità relativa", "CO2", "Temperatura esterna",
        "Radiazione solare", "Velocità vento",
    ),
    "pt": (
        "utf-8", "Data/Hora", "Temperatura interior (°C)", "Umidade relativa (%)", "CO2 (ppm)",
        "Temperatura exterior (°C)", "Radiação solar (W/m²)", "Velocidade do vento (m/s)",
    ),
    "ja": ("cp932", "日時", "室内温度(℃)", "室内湿度(%)", "CO2濃度(ppm)", "外気温(℃)", "日射量(W/m2)", "風速(m/s)"),
}  # fmt: skip


@pytest.mark.parametrize("code", LANGUAGES)
def test_a_language_is_read_in_the_encoding_of_its_country(tmp_path: Path, log: Telemetry, code: str) -> None:
    encoding, *names = LANGUAGES[code]
    written(log, names).to_csv(tmp_path / "export.csv", sep=";", decimal=",", index=False, encoding=encoding)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def _american(log: Telemetry, names: Sequence[str]) -> pd.DataFrame:
    frame = written(log, names, "%m/%d/%Y %I:%M:%S %p")
    for column in (1, 4):
        frame.isetitem(column, degrees_fahrenheit(frame.iloc[:, column]))
    frame.isetitem(6, frame.iloc[:, 6] / 0.44704)
    return frame.round(3)


@pytest.mark.parametrize(
    "names",
    [
        ("Date/Time", "Inside (°F)", "RH", "CO2", "Outside (°F)", "Solar (W/m2)", "Wind (mph)"),
        ("Date/Time", "Inside Temp (°F)", "RH", "CO2", "Outside Temp", "Solar", "Wind Speed"),
        ("Date/Time", "Zone 1 Temp", "Zone 1 RH", "Zone 1 CO2", "Outside Temp", "Solar", "Wind Speed"),
    ],
    ids=["told", "one is told", "by their size"],
)
def test_degrees_fahrenheit_are_found_on_a_day_that_is_mild_in_degc(
    tmp_path: Path, log: Telemetry, capsys, names: Sequence[str]
) -> None:
    """Of an outdoor temperature of 30 alone nobody knows what it is in; the columns beside it tell."""
    _american(log, names).to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert ("has no unit: taken for degF, as air_temperature is" in capsys.readouterr().out) == (
        "Outside (" not in names[4]
    )
    assert_reads_as(tmp_path, log)


def test_a_unit_that_the_user_gives_is_not_taken_for_another(tmp_path: Path, log: Telemetry) -> None:
    names = ("Date/Time", "Inside Temp (°F)", "RH", "CO2", "Outside Temp", "Solar", "Wind Speed")
    _american(log, names).to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path, "--unit", "outdoor_temperature=degC") == 0
    raw = degrees_fahrenheit(log["outdoor_temperature"])
    np.testing.assert_allclose(read_log(tmp_path / "export.csv").telemetry["outdoor_temperature"], raw, atol=0.01)


@pytest.mark.parametrize("outside", ["outdoor_temperature", "Outside Temp"])
def test_of_one_column_in_degf_the_others_are_no_less_themselves(
    tmp_path: Path, log: Telemetry, capsys, outside: str
) -> None:
    """Its place tells the one; what is 20 in a greenhouse is never degF, and no wind is in mph for its sake."""
    names = ("time", "air_temperature", "air_humidity", "air_co2", outside, "global_radiation", "wind_speed")
    frame = written(log, names, "%Y-%m-%d %H:%M:%S+00:00", "UTC")
    frame[outside] = degrees_fahrenheit(frame[outside] + 8.0)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert "so it is in degF" in capsys.readouterr().out
    assert_reads_as(tmp_path, log.with_columns({"outdoor_temperature": log["outdoor_temperature"] + 8.0}))


def test_wind_that_is_no_metres_a_second_may_be_told_in_mph(tmp_path: Path, log: Telemetry, capsys) -> None:
    stormy = log.with_columns({"wind_speed": log["wind_speed"] * 1.8})
    frame = written(
        stormy, ("Time", "Air temp (C)", "RH (%)", "CO2", "Outside temp (C)", "Radiation (W/m2)", "Wind speed")
    )
    frame["Wind speed"] /= 0.44704
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert "taken for km/h (--unit wind_speed=mph or knots says otherwise)" in capsys.readouterr().out
    assert imported(tmp_path, "--force", "--unit", "wind_speed=mph") == 0
    assert_reads_as(tmp_path, stormy)


def test_units_behind_the_numbers_count(tmp_path: Path, log: Telemetry) -> None:
    names = ("Time", "Greenhouse temp", "Greenhouse RH", "CO2", "Outside temp", "Solar radiation", "Wind speed")
    frame = _american(log, names)
    for column, unit in ((1, "°F"), (2, "%"), (3, "ppm"), (4, "°F"), (5, "W/m²"), (6, "mph")):
        frame.isetitem(column, [f"{value:.2f} {unit}" for value in frame.iloc[:, column]])
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def test_units_in_a_column_of_their_own_count(tmp_path: Path, log: Telemetry) -> None:
    """A reading a row: air in degF and wind in m s-1, as the column says."""
    frame = written(log, ("Time", "Air temp", "RH", "CO2", "Outside temp", "Radiation", "Wind speed"))
    for column in ("Air temp", "Outside temp"):
        frame[column] = degrees_fahrenheit(frame[column])
    long = frame.melt(id_vars="Time", var_name="sensor").sort_values("Time", kind="stable")
    units = dict(zip(frame.columns[1:], ("°F", "%", "ppm", "°F", "W/m2", "m/s"), strict=True))
    long.assign(unit=long["sensor"].map(units)).to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("Outside light (ft-candles)", 1.0 / 0.09360104),
        ("Outside PAR (µmol/m2/s)", 2.05),
        ("Outside light [klux]", 0.115),
    ],
)
def test_light_outside_is_the_suns_radiation(tmp_path: Path, log: Telemetry, name: str, factor: float) -> None:
    frame = written(log, ("Time", "Air temp (C)", "RH (%)", "CO2 (ppm)", "Outside temp (C)", name, "Wind (m/s)"))
    frame[name] *= factor
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


@pytest.mark.parametrize("locale", ["en", "de", "whole"])
def test_thousands_are_no_decimals(tmp_path: Path, log: Telemetry, locale: str) -> None:
    """980, then 1,020: the comma before three digits is none of decimals."""
    plenty = log.with_columns({"air_co2": np.round(log["air_co2"] * 2.0)})
    names = ("Time", "Air temp (C)", "RH (%)", "CO2 (ppm)", "Outside temp (C)", "Radiation (W/m2)", "Wind (m/s)")
    digits = 0 if locale == "whole" else 1
    frame = written(plenty, names, "%Y-%m-%d %H:%M")
    for column in frame.columns[1:]:
        texts = [f"{value:,.{0 if column.startswith('CO2') else digits}f}" for value in frame[column]]
        frame[column] = texts if locale == "en" else [text.translate(str.maketrans(",.", ".,")) for text in texts]
    frame.to_csv(tmp_path / "export.csv", sep="," if locale == "en" else ";", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, plenty, near=0.51)


@pytest.mark.parametrize("houses", [("Comp A", "Comp B"), ("North house", "South house")])
def test_houses_side_by_side_are_never_guessed(tmp_path: Path, log: Telemetry, capsys, houses: Sequence[str]) -> None:
    names = ("Time", *(f"{houses[1]} {one}" for one in ("temp (C)", "RH (%)", "CO2 (ppm)")))
    frame = written(log, (*names, "Outside temp (C)", "Solar (W/m2)", "Wind (m/s)"))
    for column, name in enumerate(names[1:], 1):
        frame.insert(column, name.replace(houses[1], houses[0]), frame[name] + 3.0)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    told = capsys.readouterr()
    assert "which compartment is the log of?" in told.out
    assert "is not written while this is open" in told.err
    label = {"Comp B": "b", "South house": "south"}[houses[1]]
    assert imported(tmp_path, "--compartment", label) == 0
    assert_reads_as(tmp_path, log)


def test_of_two_columns_with_one_name_none_is_taken(tmp_path: Path, log: Telemetry, capsys) -> None:
    names = ("Time", "Temperature", "Humidity", "CO2", "Temperature ", "Radiation", "Wind speed")
    written(log, names).rename(columns=str.strip).to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    assert "which column is the air_temperature? (Temperature, Temperature (2))" in capsys.readouterr().out
    both = ("--column", "air_temperature=Temperature", "--column", "outdoor_temperature=Temperature (2)")
    assert imported(tmp_path, *both) == 0
    assert_reads_as(tmp_path, log)


PLAIN = ("Time", "Air temp (C)", "RH (%)", "CO2 (ppm)", "Outside temp (C)", "Radiation (W/m2)", "Wind (m/s)")


def _footer(frame: pd.DataFrame) -> tuple[str, str]:
    return frame.to_csv(index=False) + "2020-02,20.1,80,500,7,60,3\nPage 1 of 1\n", "set aside: line 674 ('2020-02')"


def _uhr(frame: pd.DataFrame) -> tuple[str, str]:
    days, hours = zip(*(text.split() for text in frame["Time"]), strict=True)
    frame = frame.assign(Time=[f"{hour} Uhr" for hour in hours])
    frame.insert(0, "Datum", days)
    return frame.to_csv(index=False, sep=";"), "as %d/%m/%Y %H:%M Uhr"


def _month_first(frame: pd.DataFrame) -> tuple[str, str]:
    times = pd.to_datetime(frame["Time"], format="%d/%m/%Y %H:%M").dt.strftime("%b %d, %Y %I:%M %p")
    return frame.assign(Time=times).to_csv(index=False), "as %b %d, %Y %I:%M %p"


def _blocks(frame: pd.DataFrame) -> tuple[str, str]:
    """Each day with its title and its header."""
    days = [frame.iloc[row : row + 48].to_csv(index=False) for row in range(0, len(frame), 48)]
    text = "".join(f"Climate report of day {number}\n{day}\n" for number, day in enumerate(days, 1))
    return text, "no readings, set aside: line"


def _unicode_minus(frame: pd.DataFrame) -> tuple[str, str]:
    return frame.to_csv(index=False).replace(",-", ",\u2212"), ""


def _marks_of_faults(frame: pd.DataFrame) -> tuple[str, str]:
    frame = frame.astype(object)
    frame.iloc[100, 1], frame.iloc[200, 2] = "Störung", "k.A."
    return frame.to_csv(index=False), "taken for no reading: 'Störung', 'k.A.'"


def _extremes(frame: pd.DataFrame) -> tuple[str, str]:
    for column in frame.columns[1:]:
        frame[f"max. {column}"], frame[f"{column} minimum"] = frame[column] + 5.0, frame[column] - 5.0
    return frame[["Time", *sorted(frame.columns[1:], reverse=True)]].to_csv(index=False), "not used: "


def _line_breaks(frame: pd.DataFrame) -> tuple[str, str]:
    return frame.rename(columns=lambda name: name.replace(" ", "\n")).to_csv(index=False), "Air temp (C)"


@pytest.mark.parametrize(
    "habit",
    [_footer, _uhr, _month_first, _line_breaks, _blocks, _unicode_minus, _marks_of_faults, _extremes],
)
def test_an_odd_habit_is_read(
    tmp_path: Path, log: Telemetry, capsys, habit: Callable[[pd.DataFrame], tuple[str, str]]
) -> None:
    text, told = habit(written(log, PLAIN))
    (tmp_path / "export.csv").write_text(text)
    assert imported(tmp_path) == 0
    assert told in capsys.readouterr().out
    assert_reads_as(tmp_path, log)


def test_the_year_behind_a_dash_is_no_offset_from_utc(tmp_path: Path, log: Telemetry) -> None:
    """25-10-2020 in a column of its own: the hour that happens twice is told by the site's zone."""
    time = log.time + np.timedelta64((np.datetime64("2020-10-18") - np.datetime64("2020-02-01")).astype(int), "D")
    light = 0.6 * sun.extraterrestrial_radiation(time, 52.0, 4.5)
    autumn = Telemetry(time, {**log.columns, "global_radiation": light})
    frame = written(autumn, PLAIN, "%d-%m-%Y %H:%M")
    parts = frame["Time"].str.split(" ", expand=True)
    frame = frame.assign(Time=parts[1])
    frame.insert(0, "Date", parts[0])
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, autumn)


def moved(log: Telemetry, day: str) -> Telemetry:
    """The log in days of another season, with a sun that fits them."""
    time = log.time + np.timedelta64((np.datetime64(day) - np.datetime64("2020-02-01")).astype(int), "D")
    return Telemetry(time, {**log.columns, "global_radiation": 0.6 * sun.extraterrestrial_radiation(time, 52.0, 4.5)})


@pytest.mark.parametrize(
    ("zone", "day", "site", "names"),
    [
        ("Etc/GMT+5", "2020-03-05", "America/New_York", {"EST"}),
        ("Europe/Amsterdam", "2020-03-22", "Europe/Amsterdam", {"CET", "CEST"}),
        ("Europe/London", "2020-10-18", "Europe/London", {"GMT", "BST"}),
        ("America/Chicago", "2020-10-25", "America/Chicago", {"CST", "CDT"}),
        ("Asia/Shanghai", "2020-03-05", "Asia/Shanghai", {"CST"}),
        ("America/Los_Angeles", "2020-03-05", "Europe/Amsterdam", {"PST", "PDT"}),
    ],
)
@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M {}", "%d.%m.%Y %H:%M ({})", "%A, %B %d, %Y %I:%M %p {}"])
def test_each_time_may_tell_its_zone(
    tmp_path: Path, log: Telemetry, capsys, zone: str, day: str, site: str, names: set[str], form: str
) -> None:
    """EST is five hours behind UTC in summer too, whatever the clocks of the site do."""
    table = moved(log, day)
    frame = written(table, PLAIN)
    local = pd.DatetimeIndex(table.time).tz_localize("UTC").tz_convert(zone)
    called = ["EST" if zone.startswith("Etc") else str(moment.tzname()) for moment in local]
    assert set(called) == names
    frame["Time"] = [moment.strftime(form.format(name)) for moment, name in zip(local, called, strict=True)]
    frame.to_csv(tmp_path / "export.csv", index=False)
    status = imported(tmp_path, zone=site)
    told = capsys.readouterr()
    if names == {"PST", "PDT"} and site == "Europe/Amsterdam":
        assert status == 2
        assert "in which time zone are its times? (America/Los_Angeles, Asia/Manila)" in told.out
        assert imported(tmp_path, "--time-zone", zone, zone=site) == 0
    else:
        assert status == 0
        assert f"each time tells its zone: {', '.join(sorted(names))}" in told.out
    read = read_log(tmp_path / "export.csv").telemetry
    np.testing.assert_array_equal(read.time, table.time)
    np.testing.assert_allclose(read["air_co2"], table["air_co2"], atol=0.01)


@pytest.mark.parametrize("form", ["%a %d/%m/%Y %H:%M", "%Y%m%d%H%M", "%Y-%m-%dT%H:%M+01:00[Europe/Amsterdam]"])
def test_times_of_other_programs_are_read(tmp_path: Path, log: Telemetry, form: str) -> None:
    written(log, PLAIN, form).to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


def test_vents_and_screens_that_are_open_or_closed(tmp_path: Path, log: Telemetry) -> None:
    frame = written(log, PLAIN)
    frame["Roof vents"] = np.where(log["vent_lee"] > 1.0, "open", "Closed")
    frame["Thermal screen"] = np.where(log["energy_screen"] > 50.0, "CLOSED", "open")
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    table = read_log(tmp_path / "export.csv").telemetry
    np.testing.assert_array_equal(table["vent_lee"], np.where(log["vent_lee"] > 1.0, 100.0, 0.0))
    np.testing.assert_array_equal(table["energy_screen"], np.where(log["energy_screen"] > 50.0, 100.0, 0.0))


@pytest.mark.parametrize("parts", [("Year", "Month", "Day", "Hour", "Minute"), ("Date", "Hour", "Minute")])
def test_a_time_in_many_columns_is_never_read_by_some_of_them(
    tmp_path: Path, log: Telemetry, capsys, parts: Sequence[str]
) -> None:
    """The hour alone would put two rows on one time, and lose half of them."""
    frame = written(log, PLAIN).drop(columns="Time")
    local = pd.DatetimeIndex(to_local(log.time, AMSTERDAM))
    for position, part in enumerate(parts):
        frame.insert(position, part, local.strftime("%Y-%m-%d") if part == "Date" else getattr(local, part.lower()))
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 2
    told = f"its time stands in {len(parts)} columns ({', '.join(parts)}): join them in one, such as 2020-02-01 13:30"
    assert told in capsys.readouterr().err


def test_a_zip_archive_is_unpacked_beside_it(tmp_path: Path, log: Telemetry, capsys) -> None:
    frame = written(log, PLAIN)
    with zipfile.ZipFile(tmp_path / "export.zip", "w") as archive:
        for row in range(0, len(frame), 48):
            archive.writestr(f"days/{row // 48:02}.csv", frame.iloc[row : row + 48].to_csv(index=False))
        archive.writestr("__MACOSX/days/._00.csv", b"\x00\x05")
        archive.writestr("readme.txt", "Exported by the greenhouse computer.")
    assert imported(tmp_path, "--dry-run", export="export.zip") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["export.zip", "site.yaml"]
    with pytest.raises(
        IgrowError, match=r"a zip archive that is not unpacked yet \(`igrow-trainer import .*export.zip`"
    ):
        read_log(tmp_path / "export.zip")
    assert imported(tmp_path, export="export.zip") == 0
    assert f"next: igrow-trainer calibrate {tmp_path / 'export'} --site" in capsys.readouterr().out
    assert_reads_as(tmp_path, log, export="export.zip")
    assert_reads_as(tmp_path, log, export="export")
    assert imported(tmp_path, export="export.zip") == 2
    assert "export exists already" in capsys.readouterr().err


@pytest.mark.parametrize("spoilt", ["no table", "cut off", "no archive"])
def test_a_zip_archive_of_no_tables_is_refused_in_one_line(tmp_path: Path, capsys, spoilt: str) -> None:
    with zipfile.ZipFile(tmp_path / "export.zip", "w") as archive:
        archive.writestr("photo.jpg" if spoilt == "no table" else "log.csv", "x" * 9000)
    if spoilt != "no table":
        whole = (tmp_path / "export.zip").read_bytes()
        (tmp_path / "export.zip").write_bytes(b"Zip" if spoilt == "no archive" else whole[: len(whole) // 2])
    assert imported(tmp_path, export="export.zip") == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert ("no table in it" in told) or ("is no whole zip archive" in told)


def test_of_what_is_open_the_status_tells_although_a_mapping_is_written(tmp_path: Path, log: Telemetry, capsys) -> None:
    written(log, PLAIN).drop(columns="Outside temp (C)").to_csv(tmp_path / "inside.csv", index=False)
    weather = written(log, PLAIN)[["Time", "Outside temp (C)"]]
    weather.to_csv(tmp_path / "weather.csv", index=False)
    assert imported(tmp_path, export="inside.csv") == 2
    told = capsys.readouterr().out
    assert "open: which column is the outdoor_temperature, or in which other file does it stand?" in told
    assert "with the answer, --force replaces it" in told
    assert "next:" not in told
    assert (tmp_path / "inside.mapping.yaml").is_file()
    both = [str(tmp_path / name) for name in ("inside.csv", "weather.csv")]
    assert main(["import", *both, "--site", str(tmp_path / "site.yaml"), "--force"]) == 0
    assert "open: " not in capsys.readouterr().out


def test_lamps_in_per_cent_have_their_power(tmp_path: Path, log: Telemetry) -> None:
    """Their power is made of whether they burn; what sets right the one sets right the other."""
    frame = written(log, PLAIN)
    frame["AssimLight"] = np.where(log["lamp_power"] > 1.0, 100, 0)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml")
    lamps = read.known_site.greenhouse.lamps
    assert lamps is not None
    assert read.telemetry["lamp_power"].max() == pytest.approx(lamps.power)
    assert read.telemetry["lamp_on"].max() == 1.0


def test_what_is_set_aside_is_said_at_once(tmp_path: Path, log: Telemetry, capsys) -> None:
    frame = written(log, PLAIN).drop(columns="Wind (m/s)")
    frame.loc[100:119, "CO2 (ppm)"] = np.arange(9000, 9020)
    frame.to_csv(tmp_path / "export.csv", index=False)
    assert imported(tmp_path) == 0
    told = capsys.readouterr().out
    assert "note: air_co2: 20 readings" in told
    assert "note: no readings of outdoor_humidity, wind_speed: nothing is said of what needs them" in told


@pytest.mark.parametrize(
    "name",
    ["RV setpoint", "Humidity setpoint (%)", "RH setpoint %", "vochtsetpoint", "Sollwert Luftfeuchte [%]"],
)
def test_a_setpoint_of_the_humidity_is_no_reading_of_it(tmp_path: Path, log: Telemetry, name: str, capsys) -> None:
    names = ("time", "air temperature (C)", "RH (%)", "CO2 (ppm)", "outside temperature (C)", "radiation (W/m2)")
    table = written(log, (*names, "wind speed (m/s)"))
    table.insert(1, name, 83.0)
    table.to_csv(tmp_path / "export.csv", index=False)
    imported(tmp_path)
    assert_reads_as(tmp_path, log)
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml").telemetry
    np.testing.assert_array_equal(np.unique(read["humidity_setpoint"][np.isfinite(read["humidity_setpoint"])]), [83.0])
