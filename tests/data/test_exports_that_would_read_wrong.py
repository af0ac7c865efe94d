"""Exports that were read wrong without a word: each reads as the truth now, or one line says why not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core import air
from igrow.core.arrays import Floats
from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.data import read_log
from igrow.trainer.data.importing.columns import find_matches
from igrow.trainer.data.vocabulary import find_units, unknown_unit
from tests.data.test_exports_of_elsewhere import AMSTERDAM, assert_reads_as, imported, written
from tests.virtual_log import virtual_log

pytestmark = pytest.mark.usefixtures("without_picture")
DUTCH = (
    "Tijd", "Kastemperatuur (°C)", "RV kas (%)", "CO2 (ppm)", "Buitentemperatuur (°C)", "Straling (W/m2)",
    "Windsnelheid (m/s)",
)  # fmt: skip
BARE = ("Tijd", "Kastemperatuur", "RV kas", "CO2", "Buitentemperatuur", "Straling", "Windsnelheid")


@pytest.fixture(scope="module")
def log() -> Telemetry:
    """A fortnight of a mild winter, every half hour."""
    return to_grid(virtual_log(14, seed=9), 1800)


def local(log: Telemetry) -> pd.DatetimeIndex:
    return pd.DatetimeIndex(to_local(log.time, AMSTERDAM))


def dutch(log: Telemetry, names: tuple[str, ...] = DUTCH) -> pd.DataFrame:
    return written(log, names, "%d-%m-%Y %H:%M")


def semicolons(frame: pd.DataFrame) -> str:
    return str(frame.to_csv(sep=";", decimal=",", index=False))


def with_day_rows(log: Telemetry, label: Callable[[pd.Timestamp], str]) -> str:
    frame, parts = dutch(log), []
    for day, rows in frame.groupby(local(log).date):
        sums = [label(pd.Timestamp(day)), *rows.iloc[:, 1:].sum().round(1)]
        parts += [rows, pd.DataFrame([sums], columns=frame.columns)]
    return semicolons(pd.concat(parts))


def totals_under_the_last_minute(log: Telemetry) -> str:
    """The wind became km/h."""
    return with_day_rows(log, lambda day: f"{day:%d-%m-%Y} 23:59")


def totals_behind_a_word(log: Telemetry) -> str:
    return with_day_rows(log, lambda day: f"Totaal {day:%d-%m-%Y}")


def means_behind_a_word(log: Telemetry) -> str:
    return with_day_rows(log, lambda day: f"gem. {day:%d-%m-%Y}")


def whole_tenths(log: Telemetry) -> str:
    """The humidity was out of range, and the wind became km/h."""
    frame = dutch(log, BARE)
    for column in (1, 2, 4, 6):
        frame.isetitem(column, (10.0 * frame.iloc[:, column]).round().astype(int))
    return semicolons(frame)


def tenths_that_are_told(log: Telemetry) -> str:
    units = ("0,1 °C", "0,1 %", "ppm", "0.1 °C", "W/m2", "1/10 m/s")
    frame = dutch(log, ("Tijd", *(f"{name} ({unit})" for name, unit in zip(BARE[1:], units, strict=True))))
    for column in (1, 2, 4, 6):
        frame.isetitem(column, (10.0 * frame.iloc[:, column]).round().astype(int))
    return semicolons(frame)


def co2_in_pascal(log: Telemetry) -> str:
    frame = dutch(log).rename(columns={DUTCH[3]: "CO2 (Pa)"})
    return semicolons(frame.assign(**{"CO2 (Pa)": (0.101325 * log["air_co2"]).round(3)}))


def days_and_parts_of_days(log: Telemetry) -> str:
    """Each part was taken for a compartment."""
    serial = (local(log).tz_localize(None) - pd.Timestamp("1899-12-30")).total_seconds() / 86_400.0
    frame = dutch(log).drop(columns="Tijd")
    frame.insert(0, "Tijd", [f"{one % 1.0:.6f}".replace(".", ",") for one in serial])
    frame.insert(0, "Datum", [int(one) for one in serial])
    return semicolons(frame)


def french_short(log: Telemetry) -> str:
    """`Vent`, the wind, was read as vents."""
    names = (
        "Horodatage", "Temp. serre (°C)", "Hygro serre (%)", "CO2 serre (ppm)", "Temp. ext (°C)", "Ray. sol. (W/m²)",
        "Vent (m/s)",
    )  # fmt: skip
    return semicolons(written(log, names))


def japanese_short(log: Telemetry) -> str:
    return semicolons(written(log, ("日時", "内温(℃)", "内湿(%)", "CO2(ppm)", "外温(℃)", "日射(W/㎡)", "風速(m/s)")))


def polish_short(log: Telemetry) -> str:
    names = (
        "Data i czas", "Temp. w szklarni (°C)", "Wilg. w szklarni (%)", "CO2 (ppm)", "Temp. na zewnątrz (°C)",
        "Nasłonecznienie (W/m²)", "Wiatr (m/s)",
    )  # fmt: skip
    return semicolons(written(log, names))


def italian_short(log: Telemetry) -> str:
    names = ("Data Ora", "T. int. (°C)", "U.R. int. (%)", "CO2", "T. est. (°C)", "Rad. sol. (W/m²)", "Vel. vento (m/s)")
    return semicolons(written(log, names))


@pytest.mark.parametrize(
    "habit",
    [
        totals_under_the_last_minute, totals_behind_a_word, means_behind_a_word, whole_tenths, tenths_that_are_told,
        co2_in_pascal, days_and_parts_of_days, french_short, japanese_short, polish_short, italian_short,
    ],
)  # fmt: skip
def test_it_reads_as_the_truth(tmp_path: Path, log: Telemetry, habit: Callable[[Telemetry], str]) -> None:
    (tmp_path / "export.csv").write_text(habit(log))
    assert imported(tmp_path) == 0
    assert_reads_as(tmp_path, log)


@pytest.mark.parametrize(("unit", "joules"), [("J/cm2", 1e4), ("MJ/m2", 1e6)])
def test_a_sum_since_midnight_keeps_the_unit_that_its_name_tells(
    tmp_path: Path, log: Telemetry, unit: str, joules: float, capsys
) -> None:
    """It was taken for an amount a row, and then for kJ."""
    frame, days = dutch(log), local(log).date
    # What a row says came in the half hour before it.
    came = pd.Series(1800.0 * log["global_radiation"] / joules).groupby(days).cumsum()
    frame = frame.rename(columns={DUTCH[5]: f"Straling ({unit})"}).assign(**{f"Straling ({unit})": came.round(6)})
    (tmp_path / "export.csv").write_text(semicolons(frame))
    assert imported(tmp_path) == 0
    assert "global_radiation is a running sum in" in capsys.readouterr().out
    assert_reads_as(tmp_path, log)


def deficit(log: Telemetry) -> Floats:
    saturated: Floats = air.saturation_pressure(np, log["air_temperature"])
    return saturated * (1.0 - 0.01 * log["air_humidity"]) / 1000.0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Vochtigheid kas (kPa)", "is in 'kPa', which is not known: left out"),
        ("VPD (kPa)", "'VPD (kPa)' tells the humidity in another way, which is not read: export the relative"),
        ("Vochtdeficit", "'Vochtdeficit' tells the humidity in another way, which is not read"),
        ("Vochtigheid kas", "data fault: air_humidity has a median of"),
    ],
)
def test_a_deficit_in_kpa_is_no_humidity_from_0_to_1(tmp_path: Path, log: Telemetry, capsys, name, said) -> None:
    """It was multiplied by a hundred, and no word said."""
    frame = dutch(log).rename(columns={DUTCH[2]: name}).assign(**{name: deficit(log).round(3)})
    (tmp_path / "export.csv").write_text(semicolons(frame))
    imported(tmp_path)
    told = capsys.readouterr().out
    assert said in told
    assert "so it is a fraction" not in told
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml")
    assert "air_humidity" not in read.telemetry or read.faults


@pytest.mark.parametrize("name", ["Windkracht (Bft)", "Windkracht", "Wind (Beaufort)", "Windsnelheid Bft"])
def test_beaufort_is_no_speed(tmp_path: Path, log: Telemetry, capsys, name: str) -> None:
    """4 Beaufort were 4 m/s."""
    force = np.round((log["wind_speed"] / 0.836) ** (2.0 / 3.0)).astype(int)
    frame = dutch(log).rename(columns={DUTCH[6]: name}).assign(**{name: force})
    (tmp_path / "export.csv").write_text(semicolons(frame))
    imported(tmp_path)
    assert f"{name!r} is in " in capsys.readouterr().out
    assert "wind_speed" not in read_log(tmp_path / "export.csv", tmp_path / "site.yaml").telemetry


def test_vents_in_steps_are_asked_for_and_not_taken_for_per_cent(tmp_path: Path, log: Telemetry, capsys) -> None:
    steps = np.clip(np.round(log["air_temperature"] - 16.0), 0.0, 5.0).astype(int)
    (tmp_path / "export.csv").write_text(semicolons(dutch(log).assign(**{"Raamstand luwzijde": steps})))
    assert imported(tmp_path) == 2
    told = capsys.readouterr().out
    assert "in which unit is 'Raamstand luwzijde' (vent_lee)? (percent, 0-5)" in told
    assert "vent_lee" not in read_log(tmp_path / "export.csv", tmp_path / "site.yaml").telemetry
    assert imported(tmp_path, "--unit", "vent_lee=0-5", "--force") == 0
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml").telemetry
    np.testing.assert_allclose(read["vent_lee"], 20.0 * steps)
    named = dutch(log).assign(**{"Raamstand luwzijde (0-5)": steps})
    (tmp_path / "export.csv").write_text(semicolons(named))
    assert imported(tmp_path, "--force") == 0
    read = read_log(tmp_path / "export.csv", tmp_path / "site.yaml").telemetry
    np.testing.assert_allclose(read["vent_lee"], 20.0 * steps)


def in_columns(log: Telemetry) -> Mapping[str, object]:
    when = local(log).isocalendar()
    return {"Jaar": when.year.values, "Week": when.week.values, "Dag": when.day.values}


def test_times_by_the_week_are_named(tmp_path: Path, log: Telemetry, capsys) -> None:
    clock, week = local(log).strftime("%H:%M"), in_columns(log)
    columns = pd.DataFrame(week).assign(Tijd=clock).join(dutch(log).drop(columns="Tijd"))
    words = dutch(log).assign(Tijd=[f"wk {one} za {at}" for one, at in zip(week["Week"], clock, strict=True)])  # type: ignore[call-overload]
    for frame, said in (
        (columns, "its time stands in 3 columns (Jaar, Week, Dag)"),
        (words, "its times, such as 'wk 5 za 01:00', tell the week and no date: write them as 2020-02-01 13:30"),
    ):
        (tmp_path / "export.csv").write_text(semicolons(frame))
        assert imported(tmp_path) == 2
        assert said in capsys.readouterr().err


def test_a_bare_vent_is_what_its_unit_says() -> None:
    for name, quantities in (
        ("Vent (m/s)", {"wind_speed"}),
        ("Vent (%)", {"vent_lee"}),
        ("Vent lee", {"vent_lee"}),
        ("Vent", set()),
    ):
        assert {one.quantity for one in find_matches([name], {})} == quantities, name


def test_units_of_which_a_number_is_a_tenth() -> None:
    assert find_units(["0,1°c"])["temperature"].scale == pytest.approx(0.1)
    assert find_units(["1/10m/s"])["speed"].scale == pytest.approx(0.1)
    assert unknown_unit("Wind Bft") == "Bft"
    assert unknown_unit("Druk [hPa]") == "hPa"
    assert unknown_unit("Wind (km/h)") == ""
