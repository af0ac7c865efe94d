"""The weather that a plan expects: a forecast where there is one, else the last days."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry, write_csv
from igrow.edge.planning.forecast import NEEDED, forecast_in_time, from_forecast, persistence

START = 1_780_012_800
COLUMN = {name: column for column, name in enumerate(NEEDED)}


def log(days: float = 4.0, warmer_now: float = 0.0, without: tuple[str, ...] = ()) -> Telemetry:
    """Return a log whose every day is alike, the last 6 hours warmer."""
    seconds = np.arange(START - int(days * 86400), START, 300)
    day = 2 * np.pi * (seconds % 86400) / 86400
    columns = {
        "outdoor_temperature": 10.0 - 5.0 * np.cos(day) + warmer_now * (seconds >= START - 6 * 3600),
        "outdoor_humidity": 80.0 + 10.0 * np.cos(day),
        "outdoor_co2": np.full(len(seconds), 410.0),
        "global_radiation": np.maximum(0.0, -600.0 * np.cos(day)),
        "wind_speed": np.full(len(seconds), 4.0),
        "sky_temperature": np.full(len(seconds), -5.0),
    }
    return Telemetry(
        seconds.astype("datetime64[s]"), {name: values for name, values in columns.items() if name not in without}
    )


def test_days_that_are_alike_are_expected_to_go_on() -> None:
    expected = persistence(log(), START, 48)
    again = persistence(log(), START, 48)[24:]
    assert expected.shape == (48, 6)
    np.testing.assert_allclose(expected[:24], again)
    noon = 13 - (START // 3600) % 24
    assert expected[noon % 24, COLUMN["global_radiation"]] > 500.0


def test_a_warm_spell_is_expected_to_fade_within_a_day() -> None:
    usual = persistence(log(), START, 48)[:, COLUMN["outdoor_temperature"]]
    warm = persistence(log(warmer_now=6.0), START, 48)[:, COLUMN["outdoor_temperature"]]
    # A third of the anomaly enters the mean of three days for the hours that were warm.
    assert warm[0] - usual[0] > 3.0
    assert abs(warm[17] - usual[17]) < 1.5


def test_what_a_site_does_not_measure_is_estimated_where_that_is_sound() -> None:
    expected = persistence(log(without=("outdoor_co2", "sky_temperature")), START, 24)
    assert expected[:, COLUMN["outdoor_co2"]].tolist() == [420.0] * 24
    sky = expected[:, COLUMN["sky_temperature"]] - expected[:, COLUMN["outdoor_temperature"]]
    assert ((sky < -10.0) & (sky > -30.0)).all()


def test_a_log_without_wind_is_refused_by_name() -> None:
    with pytest.raises(IgrowError, match="no wind_speed"):
        persistence(log(without=("wind_speed",)), START, 24)


def test_a_log_of_one_day_is_enough() -> None:
    assert np.isfinite(persistence(log(days=1.0), START, 24)).all()


def test_a_plan_that_begins_between_hours_gets_its_own_hours() -> None:
    shifted = persistence(log(), START - 1800, 24)
    whole = persistence(log(), START, 24)
    assert abs(shifted - whole).max() > 0.0
    assert np.isfinite(shifted).all()


def test_a_forecast_is_taken_and_its_gaps_are_filled() -> None:
    seconds = np.arange(START, START + 12 * 3600, 3600)
    forecast = Telemetry(seconds.astype("datetime64[s]"), {"outdoor_temperature": np.full(12, 30.0)})
    expected = from_forecast(forecast, log(), START, 24)
    assert (expected[:12, COLUMN["outdoor_temperature"]] == 30.0).all()
    assert (expected[12:, COLUMN["outdoor_temperature"]] < 20.0).all()


def test_a_forecast_that_can_be_read_is_read(tmp_path: Path) -> None:
    seconds = np.arange(START, START + 12 * 3600, 3600)
    path = tmp_path / "forecast.csv"
    write_csv(path, Telemetry(seconds.astype("datetime64[s]"), {"outdoor_temperature": np.full(12, 30.0)}))
    members, problem = forecast_in_time(path)
    assert [len(member) for member in members] == [12]
    assert problem == ""
    assert forecast_in_time(None) == ((), "")


def test_a_forecast_that_is_missing_broken_or_too_large_costs_the_forecast_and_says_so(tmp_path: Path) -> None:
    for content, said in ((None, "No such file"), ("nonsense\n", "first column must be time")):
        path = tmp_path / "forecast.csv"
        if content is not None:
            path.write_text(content)
        members, problem = forecast_in_time(path)
        assert members == ()
        assert said in problem
        assert "weather of the last days" in problem


def test_a_forecast_on_a_share_that_hangs_costs_the_forecast_and_says_so(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("igrow.edge.planning.forecast.READ_SECONDS", 0.2)
    path = tmp_path / "forecast.csv"
    os.mkfifo(path)
    members, problem = forecast_in_time(path)
    assert members == ()
    assert f"{path}: not read within 0.2 s" in problem


def test_what_no_weather_can_be_is_a_gap_of_the_forecast() -> None:
    """Of a model that knows nothing of an hour, or of a server's fault."""
    expected = persistence(log(), START, 24)
    hours = np.arange(START, START + 24 * 3600, 3600).astype("datetime64[s]")
    columns = {name: expected[:, column] + 0.5 for name, column in COLUMN.items()}
    columns["outdoor_temperature"] = columns["outdoor_temperature"].copy()
    columns["wind_speed"] = columns["wind_speed"].copy()
    columns["outdoor_temperature"][:4] = -9999.0, np.inf, 1e308, np.nan
    columns["wind_speed"][5] = -1.0
    table = from_forecast(Telemetry(hours, columns), log(), START, 24)
    temperature, wind = COLUMN["outdoor_temperature"], COLUMN["wind_speed"]
    np.testing.assert_allclose(table[:4, temperature], expected[:4, temperature])
    np.testing.assert_allclose(table[4:, temperature], expected[4:, temperature] + 0.5)
    assert table[5, wind] == pytest.approx(expected[5, wind])
