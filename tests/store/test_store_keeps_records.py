"""What goes into the store comes out, within its bounds."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.core.telemetry import read_csv
from igrow.edge.image import Quality, Value
from igrow.edge.records import AlarmRecord
from igrow.edge.store import (
    SqliteStore,
    StoreAside,
    StoreError,
    StoreLimits,
    backup,
    export,
    read_records,
    read_telemetry,
    restore,
)
from igrow.edge.store.packing import pack, unpack_good
from igrow.edge.store.store import TELEMETRY_FILE, first_row_time
from igrow.edge.store.telemetry_file import TelemetryFile
from tests.store.store_helpers import START, values, write_record


@given(
    st.lists(
        st.tuples(
            st.one_of(st.none(), st.floats(width=32, allow_nan=False, allow_infinity=False)), st.sampled_from(Quality)
        ),
        min_size=1,
        max_size=4,
    )
)
@settings(max_examples=100, deadline=None)
def test_packing_keeps_good_values_and_hides_the_others(cells) -> None:
    names = ("air_temperature", "air_humidity", "air_co2", "par")[: len(cells)]
    row = pack(START, {name: Value(v, q, 0.0) for name, (v, q) in zip(names, cells, strict=True)})
    (found,) = unpack_good(names, [row.packed])
    for value, (number, quality) in zip(found, cells, strict=True):
        if number is None or quality is not Quality.GOOD:
            assert np.isnan(value)
        else:
            assert value == np.float32(number)


def test_a_row_of_a_length_that_no_layout_has_is_not_guessed_at() -> None:
    assert np.isnan(unpack_good(("air_temperature",), [b"123"])).all()


def test_rows_come_back_before_and_after_their_commit(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    for index in range(30):
        store.append(START + 5 * index, values(20.0 + index))
    telemetry = store.telemetry(START + 5, START + 60)
    assert telemetry["air_temperature"].tolist() == [21.0 + index for index in range(11)]
    store.close()
    assert len(read_telemetry(tmp_path, START, START + 1e6)) == 30


def test_a_clock_that_steps_back_overwrites_no_row(tmp_path: Path) -> None:
    """What was logged of these times before stays in the file, and what is logged now is what is read of them."""
    store = SqliteStore(tmp_path)
    rounds = range(3)
    for around in rounds:
        for index in range(30):
            store.append(START + 5 * index, values(20.0 + index + 100 * around))
        store.flush()
    store.close()
    with closing(sqlite3.connect(tmp_path / TELEMETRY_FILE)) as connection:
        found = connection.execute("SELECT milliseconds / 1000, packed FROM rows ORDER BY milliseconds").fetchall()
    names = tuple(values(0.0))
    kept = [(time - START, unpack_good(names, [packed])[0][names.index("air_temperature")]) for time, packed in found]
    assert kept == [(5 * index, 20.0 + index + 100 * around) for index in range(30) for around in rounds]
    telemetry = read_telemetry(tmp_path, START, START + 1e6)
    assert telemetry["air_temperature"].tolist() == [220.0 + index for index in range(30)]


def test_a_commit_of_which_nobody_knows_whether_it_was_made_can_be_repeated(tmp_path: Path) -> None:
    file = TelemetryFile(tmp_path / TELEMETRY_FILE, max_bytes=2**20, synchronous="OFF")
    rows = [pack(START + 5 * index, values(20.0 + index)) for index in range(10)]
    for batch in (rows[:6], rows, rows):
        file.add(batch)
    file.close()
    with closing(sqlite3.connect(tmp_path / TELEMETRY_FILE)) as connection:
        assert connection.execute("SELECT count(*) FROM rows").fetchone() == (10,)


def test_bad_values_read_as_missing_and_points_outside_the_registry_are_left_out(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    store.append(START, {**values(20.0, Quality.FROZEN), "heartbeat": Value(3.0, Quality.GOOD, 0.0)})
    telemetry = store.telemetry(START, START + 1)
    assert np.isnan(telemetry["air_temperature"][0])
    assert telemetry["air_humidity"][0] == 80.0
    assert "heartbeat" not in telemetry


def test_a_site_that_gains_a_point_keeps_its_older_rows(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    store.append(START, values(20.0))
    store.append(START + 5, {**values(21.0), "wind_speed": Value(4.0, Quality.GOOD, 0.0)})
    telemetry = store.telemetry(START, START + 10)
    assert telemetry["air_temperature"].tolist() == [20.0, 21.0]
    assert np.isnan(telemetry["wind_speed"][0])
    assert telemetry["wind_speed"][1] == 4.0


def test_telemetry_is_committed_once_a_minute_and_not_before(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    for index in range(12):
        store.append(START + 5 * index, values(20.0))
    assert len(read_telemetry(tmp_path, 0.0, 8e9)) == 0
    store.append(START + 60, values(20.0))
    assert len(read_telemetry(tmp_path, 0.0, 8e9)) == 13


def test_the_file_stays_bounded_and_the_oldest_days_go_first(tmp_path: Path) -> None:
    limit = 2**20
    store = SqliteStore(tmp_path, StoreLimits(telemetry_bytes=limit, batch_seconds=3600.0))
    rows = 40 * 288 * 5
    for index in range(rows):
        store.append(START + 60.0 * index, values(20.0))
    telemetry = store.telemetry(0.0, 8e9)
    assert (tmp_path / "telemetry.db").stat().st_size <= limit
    assert telemetry.time[-1] == np.datetime64(int(START + 60 * (rows - 1)), "s")
    assert 288 * 5 < len(telemetry) < rows
    assert store.health == ""


def test_the_ledger_stays_bounded_by_forgetting_clamps_before_events(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path, StoreLimits(ledger_bytes=2**20, survive_power_cut=False))
    for index in range(50):
        store.record_event(START, "kept", {"number": index})
    for index in range(8000):
        store.record_write(write_record(START + index, "clamped"))
    assert len(store.records("event", 10**6)) == 50
    newest = store.records("write", 1)[0]
    assert newest.time == START + 7999
    assert store.health == ""
    store.close()
    for name in ("ledger-a.db", "ledger-b.db"):
        assert (tmp_path / name).stat().st_size <= 2**20


def test_writes_of_the_last_day_are_counted_across_a_restart(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    for hours in range(30):
        store.record_write(write_record(START + 3600 * hours))
        store.record_write(write_record(START + 3600 * hours, "clamped"))
    store.close()
    found = SqliteStore(tmp_path).writes_of_last_day(None)
    assert [record.time for record in found] == [START + 3600 * hours for hours in range(5, 30)]
    assert {record.outcome for record in found} == {"written"}


def test_records_made_while_the_clock_was_wrong_keep_their_order(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    store.record_event(START, "first", {})
    store.record_event(None, "second", {})
    store.record_alarm(AlarmRecord(None, 3.0, "clock", True, "the clock is not set"))
    assert [record.body["kind"] for record in store.records("event", 10)] == ["second", "first"]
    assert store.records("alarm", 1)[0].body["name"] == "clock"


def test_a_backup_of_a_running_store_is_restored_elsewhere(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store")
    store.append(START, values(20.0))
    store.record_event(START, "kept", {"number": 1})
    store.flush()
    backup(tmp_path / "store", tmp_path / "copy.tar.gz")
    restore(tmp_path / "copy.tar.gz", tmp_path / "other")
    other = SqliteStore(tmp_path / "other")
    assert other.telemetry(0, 8e9)["air_temperature"].tolist() == [20.0]
    assert other.records("event", 1)[0].body["detail"] == {"number": 1}
    store.close()


def test_a_restore_refuses_a_log_that_a_moved_store_left_behind(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store")
    store.append(START, values(20.0))
    store.close()
    archive = backup(tmp_path / "store", tmp_path / "copy.tar.gz")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "telemetry.db-wal").write_bytes(b"left")
    with pytest.raises(StoreError, match=r"telemetry\.db-wal: exists; move all of"):
        restore(archive, tmp_path / "other")


def test_only_records_after_a_sequence_number_are_read(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path)
    for number in range(5):
        store.record_event(START, "test", {"number": number})
    store.close()
    assert [record.sequence for record in read_records(tmp_path, "event", after=3)] == [5, 4]


def test_the_newest_event_of_a_kind_is_found_among_others(tmp_path: Path) -> None:
    store = StoreAside(tmp_path)
    assert store.newest_event("plan") is None
    for number, kind in enumerate(("plan", "plan", "adopted")):
        store.record_event(1.7e9 + number, kind, {"number": number})
    assert store.newest_event("plan") == {"number": 1}
    store.close()


def test_a_restore_refuses_a_damaged_backup_and_a_store_in_the_way(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store")
    store.append(START, values(20.0))
    store.flush()
    archive = backup(tmp_path / "store", tmp_path / "copy.tar.gz")
    with pytest.raises(StoreError, match="exists; move all of"):
        restore(archive, tmp_path / "store")
    archive.write_bytes(archive.read_bytes()[:-40])
    with pytest.raises(StoreError, match="cannot be restored"):
        restore(archive, tmp_path / "other")
    assert not list((tmp_path / "other").iterdir())


def test_an_export_gives_a_telemetry_file_for_each_day_and_a_table_of_each_kind_of_record(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store")
    for hour in range(48):
        store.append(START + 3600 * hour, values(20.0))
    store.record_event(START, "kept", {"number": 1})
    store.record_write(write_record(None))
    store.flush()
    files = export(tmp_path / "store", tmp_path / "out")
    days = [file for file in files if file.name.startswith("telemetry-")]
    assert sum(len(read_csv(day)) for day in days) == 48
    assert (tmp_path / "out" / "events.csv").read_text().splitlines()[1].startswith("1,kept")
    assert "heating_setpoint" in (tmp_path / "out" / "writes.csv").read_text()
    assert read_records(tmp_path / "store", "event")[0].body["kind"] == "kept"


def test_an_export_of_a_folder_without_a_store_says_so(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no store here"):
        export(tmp_path, tmp_path / "out")


def test_a_store_that_is_just_being_made_has_no_rows_yet(tmp_path: Path) -> None:
    (tmp_path / "telemetry.db").touch()
    assert len(read_telemetry(tmp_path, 0.0, 8e9)) == 0


def test_a_store_whose_first_row_is_still_to_come_is_an_empty_log(tmp_path: Path) -> None:
    assert len(read_telemetry(tmp_path, 0.0, 8e9)) == 0
    assert first_row_time(tmp_path, 0.0) is None
    with pytest.raises(StoreError, match="the log cannot be read"):
        read_telemetry(tmp_path / "nowhere", 0.0, 8e9)
