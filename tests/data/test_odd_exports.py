"""Exports as people really make them: each is read, or what is odd about it is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.local_time import to_local
from igrow.core.site import load_site
from igrow.core.telemetry import Telemetry, to_grid
from igrow.trainer.cli import main
from igrow.trainer.data import read_log
from igrow.trainer.data.timestamps import to_utc
from tests.virtual_log import virtual_log

NAMES = {
    "Lufttemperatur [°C]": "air_temperature",
    "Rel. Luftfeuchte [%]": "air_humidity",
    "CO2 [ppm]": "air_co2",
    "Außentemperatur [°C]": "outdoor_temperature",
    "Globalstrahlung [W/m²]": "global_radiation",
}


@pytest.fixture(scope="module")
def log() -> Telemetry:
    return to_grid(virtual_log(12, seed=3), 3600)


def _plain(frame: pd.DataFrame) -> str:
    return str(frame.to_csv(sep=";", decimal=",", index=False))


def _one_digit(frame: pd.DataFrame, local: pd.DatetimeIndex) -> tuple[str, str]:
    return _plain(frame.assign(Zeit=[f"{t.day}.{t.month}.{t.year} {t.hour}:{t.minute:02d}" for t in local])), ""


def _day_once(frame: pd.DataFrame, local: pd.DatetimeIndex) -> tuple[str, str]:
    frame = frame.assign(Zeit=local.strftime("%H:%M"))
    days = [t.strftime("%d.%m.%Y") if row == 0 or t.hour == 0 else "" for row, t in enumerate(local)]
    frame.insert(0, "Datum", days)
    return _plain(frame), "the day above holds"


def _sums(frame: pd.DataFrame, _local: pd.DatetimeIndex) -> tuple[str, str]:
    return _plain(frame) + "Minimum;10,1;50;400;0;0\nMittelwert;20;80;600;7;60\n", "no readings, set aside: line 290"


def _header_again(frame: pd.DataFrame, _local: pd.DatetimeIndex) -> tuple[str, str]:
    lines = _plain(frame).splitlines()
    return "\n".join([*lines[:100], lines[0], *lines[100:]]), "no readings, set aside: line 101 ('Zeit')"


def _hours_from_one(frame: pd.DataFrame, local: pd.DatetimeIndex) -> tuple[str, str]:
    frame = frame.rename(columns={"Zeit": "Stunde"}).assign(Stunde=local.hour + 1)
    frame.insert(0, "Datum", local.strftime("%Y-%m-%d"))
    return _plain(frame), ""


def _midnight_as_24(frame: pd.DataFrame, local: pd.DatetimeIndex) -> tuple[str, str]:
    before = local - pd.Timedelta(days=1)
    times = [
        f"{b:%d.%m.%Y} 24:00" if t.hour == 0 else f"{t:%d.%m.%Y %H:%M}" for t, b in zip(local, before, strict=True)
    ]
    return _plain(frame.assign(Zeit=times)), ""


def _shuffled(frame: pd.DataFrame, _local: pd.DatetimeIndex) -> tuple[str, str]:
    mixed = pd.concat([frame, frame.iloc[50:90]]).sample(frac=1, random_state=1)
    return _plain(mixed), "40 rows have the time of another row"


@pytest.mark.parametrize(
    ("spoil", "late"),
    [
        (_one_digit, 0),
        (_day_once, 0),
        (_sums, 0),
        (_header_again, 0),
        (_hours_from_one, 1),
        (_midnight_as_24, 0),
        (_shuffled, 0),
    ],
)
def test_an_odd_export_is_read_and_what_is_odd_is_said(
    tmp_path: Path, log: Telemetry, capsys: pytest.CaptureFixture[str], spoil: Callable[..., tuple[str, str]], late: int
) -> None:
    local = pd.DatetimeIndex(to_local(log.time, "Europe/Amsterdam"))
    frame = pd.DataFrame({theirs: log[ours] for theirs, ours in NAMES.items()}).round(3)
    frame.insert(0, "Zeit", local.strftime("%d.%m.%Y %H:%M"))
    text, told = spoil(frame, local)
    (tmp_path / "export.csv").write_text(text, encoding="utf-8-sig")
    site = tmp_path / "site.yaml"
    site.write_text("name: westland\nlatitude: 52.0\nlongitude: 4.5\ntime_zone: Europe/Amsterdam\n")
    assert main(["import", str(tmp_path / "export.csv"), "--site", str(site)]) == 0
    printed = capsys.readouterr().out
    assert "data fault" not in printed
    assert told in printed
    read = read_log(tmp_path / "export.csv", load_site(site)).telemetry
    assert read.time[0] == log.time[0] + np.timedelta64(late, "h")
    for ours in NAMES.values():
        np.testing.assert_allclose(read[ours], log[ours], atol=0.002)


def test_standard_time_all_the_year_is_found_by_the_change_of_clocks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = virtual_log(16, seed=3)
    # Spring: local clocks go forward on 29 March, those of the export do not. The sun of the log follows its dates.
    spring = to_grid(Telemetry(table.time + np.timedelta64(51, "D"), table.columns), 3600)
    frame = pd.DataFrame({theirs: spring[ours] for theirs, ours in NAMES.items()}).round(3)
    frame.insert(0, "Zeit", pd.DatetimeIndex(to_local(spring.time, "Etc/GMT-1")).strftime("%d.%m.%Y %H:%M"))
    (tmp_path / "export.csv").write_text(_plain(frame))
    site = tmp_path / "site.yaml"
    site.write_text("name: westland\nlatitude: 52.0\nlongitude: 4.5\ntime_zone: Europe/Amsterdam\n")
    assert main(["import", str(tmp_path / "export.csv"), "--site", str(site)]) == 0
    assert "times are Etc/GMT-1" in capsys.readouterr().out
    assert read_log(tmp_path / "export.csv", load_site(site)).telemetry.time[0] == spring.time[0]


@pytest.mark.parametrize("backwards", [False, True])
def test_the_hour_that_happens_twice_is_two_hours_of_an_hourly_log(backwards: bool) -> None:
    """Both stood at the first, so that an hour was lost and another had its readings."""
    times = np.arange(np.datetime64("2020-10-24T00:00", "h"), np.datetime64("2020-10-27T00:00", "h"))
    written = pd.DatetimeIndex(to_local(times.astype("datetime64[s]"), "Europe/Amsterdam")).strftime("%d/%m/%Y %H:%M")
    assert (written == "25/10/2020 02:00").sum() == 2
    order = slice(None, None, -1) if backwards else slice(None)
    read, wrong = to_utc(list(written[order]), "%d/%m/%Y %H:%M", "Europe/Amsterdam")
    assert wrong is None
    np.testing.assert_array_equal(read, times[order].astype("datetime64[s]"))
