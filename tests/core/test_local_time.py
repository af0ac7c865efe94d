"""Wall time and UTC, over the days when the clock changes."""

from __future__ import annotations

from zoneinfo import ZoneInfoNotFoundError

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.local_time import from_local, hour_of_day, to_local

ZONE = "Europe/Amsterdam"


def span(start: str, minutes: int, count: int) -> np.ndarray:
    return np.datetime64(start, "s") + np.arange(count) * np.timedelta64(minutes * 60, "s")


def test_summer_and_winter_differ_by_an_hour() -> None:
    utc = np.array(["2020-01-15T11:00", "2020-07-15T11:00"], dtype="datetime64[s]")
    np.testing.assert_array_equal(hour_of_day(utc, ZONE), [12.0, 13.0])


@pytest.mark.parametrize("start", ["2020-03-29T00:00", "2020-10-24T22:00", "2020-06-01T00:00"])
@pytest.mark.parametrize("zone", [ZONE, "Asia/Kathmandu", "Australia/Lord_Howe", "America/New_York", "UTC"])
def test_utc_comes_back_from_wall_time_written_in_order(start: str, zone: str) -> None:
    utc = span(start, 5, 100)
    np.testing.assert_array_equal(from_local(to_local(utc, zone), zone), utc)


def test_a_wall_time_that_the_clock_skips_never_was() -> None:
    wall = span("2020-03-29T01:50", 5, 16)
    utc = from_local(wall, ZONE)
    np.testing.assert_array_equal(np.isnat(utc), (wall >= np.datetime64("2020-03-29T02:00")) & (wall < wall[14]))


def test_an_unknown_zone_is_named() -> None:
    with pytest.raises(IgrowError, match="Europe/Nowhere"):
        to_local(span("2020-01-01", 5, 2), "Europe/Nowhere")


def test_a_machine_without_time_zones_says_what_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(name: str) -> None:
        raise ZoneInfoNotFoundError(name)

    monkeypatch.setattr("igrow.core.local_time.ZoneInfo", unknown)
    monkeypatch.setattr("igrow.core.local_time.available_timezones", set)
    with pytest.raises(IgrowError, match="no time zone at all: install tzdata"):
        to_local(np.array(["2026-06-01"], dtype="datetime64[s]"), "Europe/Amsterdam")
