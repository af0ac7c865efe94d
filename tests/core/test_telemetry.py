"""The telemetry table and its CSV file."""

from __future__ import annotations

import gzip
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.telemetry import (
    Telemetry,
    TelemetryError,
    concatenate,
    from_rows,
    read_csv,
    to_grid,
    write_csv,
)


def times(*texts: str) -> np.ndarray:
    return np.array(texts, dtype="datetime64[s]")


def table(count: int = 10, step: int = 300) -> Telemetry:
    time = np.datetime64("2020-01-31T12:00:00") + np.arange(count) * np.timedelta64(step, "s")
    rising = 20.0 + np.arange(count, dtype=np.float64)
    return Telemetry(time, {"air_temperature": rising, "air_co2": np.full(count, 600.0)})


def refused(path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(TelemetryError) as caught:
        read_csv(path)
    return str(caught.value)


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_what_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    values = np.array([20.123456, np.nan, -3.5])
    telemetry = Telemetry(times("2020-01-01", "2020-01-02T03:04:05", "2020-01-03"), {"air_temperature": values})
    write_csv(tmp_path / name, telemetry)
    back = read_csv(tmp_path / name)
    np.testing.assert_array_equal(back.time, telemetry.time)
    np.testing.assert_allclose(back["air_temperature"], values, rtol=1e-6)
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_equal_telemetry_gives_an_equal_gzip_file(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv.gz", table())
    write_csv(tmp_path / "b.csv.gz", table())
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()


def test_rows_in_any_order_are_sorted_and_the_later_row_of_one_time_wins_where_it_has_a_value(
    tmp_path: Path,
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        "time,air_temperature,air_co2\n2020-01-02T00:00:00Z,2,\n2020-01-01T00:00:00Z,1,500\n2020-01-01T00:00:00Z,9,\n"
    )
    telemetry = read_csv(path)
    np.testing.assert_array_equal(telemetry.time, times("2020-01-01", "2020-01-02"))
    np.testing.assert_array_equal(telemetry["air_temperature"], [9.0, 2.0])
    np.testing.assert_array_equal(telemetry["air_co2"], [500.0, np.nan])


def test_an_unknown_column_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    message = refused(tmp_path / "log.csv", "time,air_temprature\n2020-01-01T00:00:00Z,1\n")
    assert message == f"{tmp_path}/log.csv:1: column air_temprature is no known quantity: did you mean air_temperature?"


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        ("air_co2\n1\n", ":1:", "the first column must be time"),
        ("", ":1:", "the first column must be time"),
        ("time,air_co2,air_co2\n", ":1:", "stands twice"),
        (
            "time,air_co2\n2020-01-01T00:00:00Z,1\n2020-01-01T00:05:00Z\n",
            ":3:",
            "1 cells where the header has 2",
        ),
        ("time,air_co2\n2020-01-01T00:00:00Z,high\n", ":2:", "air_co2 is 'high'"),
        ("time,air_co2\n2020-01-01T00:00:00Z,inf\n", ":2:", "infinite"),
        ("time,air_co2\n2020-01-01T00:00:00Z,1\n2020-13-01T00:00:00Z,1\n", ":3:", "2020-01-31T12:05:00Z"),
        ("time,air_co2\n2020-01-01T00:00:00,1\n", ":2:", "2020-01-31T12:05:00Z"),
    ],
)
def test_a_broken_file_is_refused_with_its_line(tmp_path: Path, text: str, where: str, what: str) -> None:
    message = refused(tmp_path / "log.csv", text)
    assert where in message
    assert what in message


def test_a_cut_gzip_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"time,air_co2\n" + b"2020-01-01T00:00:00Z,1\n" * 100)[:-12])
    with pytest.raises(TelemetryError, match="ends too early"):
        read_csv(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TelemetryError, match=r"none\.csv: cannot be read: No such file"):
        read_csv(tmp_path / "none.csv")


def test_times_that_do_not_increase_are_refused() -> None:
    with pytest.raises(TelemetryError, match="strictly increase"):
        Telemetry(times("2020-01-02", "2020-01-02"), {})


def test_a_table_cannot_be_written_to_nor_changed_from_outside() -> None:
    values = np.array([1.0, 2.0])
    telemetry = Telemetry(times("2020-01-01", "2020-01-02"), {"air_co2": values})
    values[0] = 99.0
    assert telemetry["air_co2"][0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        telemetry["air_co2"][0] = 2.0


def test_a_missing_column_is_named_with_the_nearest_one() -> None:
    with pytest.raises(TelemetryError, match="did you mean air_temperature"):
        table()["air_temperatur"]


def test_select_takes_its_start_and_leaves_its_end() -> None:
    telemetry = table()
    part = telemetry.select(telemetry.time[2], telemetry.time[5])
    np.testing.assert_array_equal(part.time, telemetry.time[2:5])
    assert telemetry.step == 300.0


def test_a_table_survives_pickling() -> None:
    back = pickle.loads(pickle.dumps(table()))
    np.testing.assert_array_equal(back["air_temperature"], table()["air_temperature"])


def test_joined_tables_have_all_columns_and_later_ones_count_first() -> None:
    first = Telemetry(times("2020-01-01", "2020-01-02"), {"air_co2": np.array([1.0, 2.0])})
    second = Telemetry(
        times("2020-01-02", "2020-01-03"), {"air_co2": np.array([20.0, 3.0]), "rain": np.array([0.0, 1.0])}
    )
    joined = concatenate([first, second])
    np.testing.assert_array_equal(joined["air_co2"], [1.0, 20.0, 3.0])
    np.testing.assert_array_equal(joined["rain"], [np.nan, 0.0, 1.0])
    assert len(concatenate([])) == 0


def test_a_grid_holds_the_mean_of_each_step_and_nan_in_gaps() -> None:
    telemetry = Telemetry(
        times("2020-01-01T00:05", "2020-01-01T00:55", "2020-01-01T02:30"),
        {"air_co2": np.array([400.0, 600.0, 800.0]), "rain": np.array([np.nan, 1.0, np.nan])},
    )
    grid = to_grid(telemetry, 3600)
    np.testing.assert_array_equal(grid.time, times("2020-01-01T00", "2020-01-01T01", "2020-01-01T02"))
    np.testing.assert_array_equal(grid["air_co2"], [500.0, np.nan, 800.0])
    np.testing.assert_array_equal(grid["rain"], [1.0, np.nan, np.nan])


def test_directions_are_averaged_on_the_circle() -> None:
    telemetry = Telemetry(times("2020-01-01T00:00", "2020-01-01T00:30"), {"wind_direction": np.array([350.0, 20.0])})
    np.testing.assert_allclose(to_grid(telemetry, 3600)["wind_direction"], [5.0], atol=1e-9)


@given(st.lists(st.tuples(st.integers(0, 50), st.one_of(st.none(), st.floats(-20, 60))), max_size=60))
def test_merging_rows_keeps_the_last_value_of_every_time(rows: list[tuple[int, float | None]]) -> None:
    expected: dict[int, float] = {}
    for second, value in rows:
        if value is not None or second not in expected:
            expected[second] = float("nan") if value is None else value
    merged = from_rows(
        np.array([second for second, _ in rows], dtype="datetime64[s]"),
        {"air_temperature": np.array([np.nan if value is None else value for _, value in rows], dtype=float)},
    )
    assert merged.time.astype(int).tolist() == sorted(expected)
    np.testing.assert_array_equal(merged["air_temperature"], [expected[second] for second in sorted(expected)])
