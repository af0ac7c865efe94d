"""Forecasts as Open-Meteo writes them: one course or an ensemble, any unit, and every fault told in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.planner import Budget
from igrow.core.telemetry import Telemetry
from igrow.edge.planning.make_plan import make_plan
from igrow.edge.planning.open_meteo import MOST_MEMBERS, read_forecast
from igrow.edge.ports import Plan
from tests.planning.test_plan_from_bundle import SITE, START, request

HOURS = 26


def content(*suffixes: str, unix: bool = False, **units: str) -> dict[str, Any]:
    """Return what the API answers for some hours from the plan's start, local time two hours ahead of UTC."""
    times = START + 3600 * np.arange(HOURS)
    local = (times + 7200).astype("datetime64[s]").astype("datetime64[m]").astype(str).tolist()
    hourly: dict[str, Any] = {"time": times.tolist() if unix else local}
    for number, suffix in enumerate(suffixes or ("",)):
        hourly[f"temperature_2m{suffix}"] = [10.0 + number] * HOURS
        hourly[f"relative_humidity_2m{suffix}"] = [80] * HOURS
        hourly[f"shortwave_radiation{suffix}"] = [float(100 * hour) for hour in range(HOURS)]
        hourly[f"wind_speed_10m{suffix}"] = [18.0] * HOURS
    return {"utc_offset_seconds": 0 if unix else 7200, "hourly_units": units, "hourly": hourly}


def write(folder: Path, given: Any) -> Path:
    path = folder / "forecast.json"
    path.write_text(given if isinstance(given, str) else json.dumps(given))
    return path


def test_a_course_is_read_in_our_units_and_in_utc(tmp_path: Path) -> None:
    (course,) = read_forecast(write(tmp_path, content()))
    assert course.time[0] == np.datetime64(START, "s")
    assert course["wind_speed"][0] == pytest.approx(5.0), "km/h where no unit is told"
    # Radiation is the mean of the hour before its time.
    assert course["global_radiation"][:3].tolist() == [100.0, 200.0, 300.0]
    assert np.isnan(course["global_radiation"][-1])
    (other,) = read_forecast(write(tmp_path, content(unix=True, wind_speed_10m="m/s", temperature_2m="°F")))
    assert other["wind_speed"][0] == 18.0
    assert other["outdoor_temperature"][0] == pytest.approx(-12.222, abs=1e-3)
    np.testing.assert_array_equal(other.time, course.time)


def test_an_ensemble_is_read_by_its_members_as_many_as_there_is_time_for(tmp_path: Path) -> None:
    three = read_forecast(write(tmp_path, content("", "_member01", "_member02")))
    assert [one["outdoor_temperature"][0] for one in three] == [10.0, 11.0, 12.0]
    many = read_forecast(write(tmp_path, content("", *(f"_member{n:02d}" for n in range(1, 31)))))
    assert len(many) == MOST_MEMBERS
    spread = [one["outdoor_temperature"][0] for one in many]
    assert spread == sorted(set(spread)) and max(spread) > 35.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("{", "forecast.json: not JSON"),
        ({"error": True, "reason": "Daily API request limit exceeded"}, "Daily API request limit exceeded"),
        ([], "a list where an object with names is needed"),
        ({"hourly": 5}, "holds no `hourly` weather"),
        ("[" * 100_000, "nested too deeply"),
        ("9" * 5000, "forecast.json: not JSON"),
        ({"hourly": {"time": [1, 2], "temperature_2m": [1, 10**400]}}, "forecast.json: not JSON"),
        ({"hourly": {"time": [1, 2]}, "hourly_units": ["m/s"]}, "holds no units by name"),
        ({"hourly": {"time": [None, 2]}}, "is no time"),
        ({"hourly": {"time": [1, 1e300]}}, "is no time"),
        ({"hourly": {"time": []}}, "lacks time"),
        ({"hourly": {"time": ["2026-05-29T00:00", "yesterday"]}}, "is no time"),
        ({"hourly": {"time": [2, 1], "temperature_2m": [1, 2]}}, "must follow one another"),
        ({"hourly": {"time": [1, 2]}}, "lacks temperature_2m, relative_humidity_2m"),
        ({"hourly": {"time": [1, 2], "temperature_2m": [1]}}, "temperature_2m has 1 values for 2 times"),
        ({"hourly": {"time": [1, 2], "temperature_2m": [1, "warm"]}}, "holds what is no number"),
        ({"hourly": {"time": [1, 2], "temperature_2m": [1, 2]}}, "lacks relative_humidity_2m"),
    ],
)
def test_a_file_that_is_no_forecast_is_refused_in_one_line(tmp_path: Path, given: Any, told: str) -> None:
    with pytest.raises(IgrowError) as caught:
        read_forecast(write(tmp_path, given))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="wind_speed_10m is in furlong"):
        read_forecast(write(tmp_path, content(wind_speed_10m="furlong")))


@pytest.mark.slow
def test_a_plan_holds_against_the_spread_of_an_ensemble(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Members that differ add to the doubt that caution takes off."""
    monkeypatch.setattr("igrow.edge.planning.make_plan.Budget", lambda: Budget(candidates=400))
    path = write(tmp_path, content("", "_member01", "_member02", unix=True))
    members = read_forecast(path)
    wild = tuple(
        one.with_columns({"outdoor_temperature": one["outdoor_temperature"] + 12.0 * (number - 1)})
        for number, one in enumerate(members)
    )

    def plan_with(forecast: tuple[Telemetry, ...]) -> Plan:
        monkeypatch.setattr("igrow.edge.planning.make_plan.forecast_in_time", lambda _: (forecast, ""))
        return make_plan(SITE, replace(request(), forecast=path))

    calm, spread = plan_with((members[0],) * 3), plan_with(wild)
    assert calm.explanation is not None and spread.explanation is not None
    assert spread.explanation.plan["heat"].deviation > 2.0 * calm.explanation.plan["heat"].deviation
    assert np.isfinite(spread.expected_profit)
