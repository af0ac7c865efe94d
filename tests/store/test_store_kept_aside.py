"""The store as the daemon has it: a disk that hangs holds nobody, and loses nothing that it was told."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from igrow.edge.hand_off import LateError
from igrow.edge.image import Quality, Value
from igrow.edge.records import AlarmRecord, WriteRecord
from igrow.edge.store import SqliteStore, StoreAside, StoreError, StoreLimits, read_records
from igrow.edge.store import aside as aside_module
from tests.patience import PATIENCE as SOON

LIMITS = StoreLimits(survive_power_cut=False)


class Disk:
    """Lets the store's thread through, or not."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.answers = threading.Event()
        self.answers.set()
        for name in ("__init__", "add", "flush", "record_event", "record_write", "record_state", "record_alarm"):
            monkeypatch.setattr(SqliteStore, name, self._slowed(getattr(SqliteStore, name)))

    def _slowed(self, call):
        def slowed(*arguments, **named):
            self.answers.wait()
            return call(*arguments, **named)

        return slowed


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    one = Disk(monkeypatch)
    yield one
    one.answers.set()


def kinds(folder: Path) -> list[str]:
    return sorted(str(record.body["kind"]) for record in read_records(folder, "event"))


def test_what_was_recorded_while_the_disk_hung_is_there_in_its_order_when_it_answers(tmp_path: Path, disk) -> None:
    store = StoreAside(tmp_path, LIMITS, patience=0.05)
    store.record_event(1.8e9, "before", {})
    store.flush()
    disk.answers.clear()
    begin = time.monotonic()
    for number in range(50):
        store.record_event(1.8e9 + number, f"event_{number:02d}", {"number": number})
        store.append(1.8e9 + number, {"air_temperature": Value(float(number), Quality.GOOD, 0.0)})
    store.record_write(WriteRecord(1.8e9, 1.0, "co2_setpoint", 700.0, 700.0, "plan", "", "written"))
    store.record_alarm(AlarmRecord(1.8e9, 1.0, "link", True, "down"))
    store.record_state(1.8e9, {"points": {}})
    assert time.monotonic() - begin < SOON
    assert kinds(tmp_path) == ["before"]
    disk.answers.set()
    store.flush()
    assert kinds(tmp_path) == ["before", *(f"event_{number:02d}" for number in range(50))]
    log = store.telemetry(1.8e9 - 1, 1.8e9 + 100)
    assert list(log["air_temperature"]) == [float(number) for number in range(50)]
    assert len(list(read_records(tmp_path, "write"))) == 1
    store.close()


def test_a_disk_that_hangs_from_the_start_delays_the_first_records_and_not_the_start(tmp_path: Path, disk) -> None:
    disk.answers.clear()
    begin = time.monotonic()
    store = StoreAside(tmp_path, LIMITS, patience=0.05)
    store.record_event(None, "started", {})
    assert time.monotonic() - begin < SOON
    earlier = store.earlier(0.0)
    disk.answers.set()
    earlier.result(SOON)
    store.flush()
    assert kinds(tmp_path) == ["started"]
    store.close()


def test_it_says_that_its_disk_hangs_and_no_longer_when_it_answers(tmp_path: Path, disk) -> None:
    store = StoreAside(tmp_path, LIMITS, patience=0.01)
    store.flush()
    store._aside._late_after = 0.05
    assert store.health == ""
    disk.answers.clear()
    store.record_event(None, "waits", {})
    until = time.monotonic() + SOON
    while not store.health and time.monotonic() < until:
        time.sleep(0.01)
    assert "the log: no answer for" in store.health
    disk.answers.set()
    store.flush()
    assert store.health == ""
    store.close()


def test_a_reader_is_told_that_the_disk_hangs(tmp_path: Path, disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = StoreAside(tmp_path, LIMITS, patience=0.01)
    store.flush()
    monkeypatch.setattr(aside_module, "READ_SECONDS", 0.05)
    disk.answers.clear()
    with pytest.raises(LateError, match="the disk has not answered"):
        store.flush()
    with pytest.raises(LateError):
        store.telemetry(0.0, 1.0)
    disk.answers.set()
    store.close()


def test_a_stop_leaves_a_disk_behind_that_hangs(tmp_path: Path, disk, monkeypatch: pytest.MonkeyPatch) -> None:
    store = StoreAside(tmp_path, LIMITS, patience=0.01)
    store.flush()
    monkeypatch.setattr(aside_module, "CLOSE_SECONDS", 0.05)
    disk.answers.clear()
    store.record_event(None, "stopped", {})
    begin = time.monotonic()
    with pytest.raises(StoreError, match="pieces of work are lost"):
        store.close()
    assert time.monotonic() - begin < SOON
    store.append(1.8e9, {"air_temperature": Value(1.0, Quality.GOOD, 0.0)})  # nobody listens any more


def test_a_queue_that_is_full_loses_the_newest_and_says_how_many(tmp_path: Path, disk) -> None:
    store = StoreAside(tmp_path, LIMITS, patience=0.01)
    store.flush()
    store._aside._longest_queue, store._aside._late_after = 5, 0.0
    disk.answers.clear()
    for number in range(9):
        store.append(1.8e9 + number, {"air_temperature": Value(float(number), Quality.GOOD, 0.0)})
    until = time.monotonic() + SOON
    while not store.health and time.monotonic() < until:
        time.sleep(0.01)
    assert store.health.endswith("could not wait")
    store._aside._longest_queue = 100
    disk.answers.set()
    store.flush()
    assert list(store.telemetry(1.8e9 - 1, 1.8e9 + 100)["air_temperature"])[:5] == [0.0, 1.0, 2.0, 3.0, 4.0]
    store.close()
