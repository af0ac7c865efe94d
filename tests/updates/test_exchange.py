"""What the gateway leaves for the trainer: whole days, each record once, at a cost that does not grow."""

from __future__ import annotations

import gzip
import json
import tracemalloc
from pathlib import Path

from igrow.core.telemetry import read_csv
from igrow.edge.exchange import DAY, GRACE_SECONDS, FolderExchange
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore, StoreLimits

FIRST_DAY = 20_000
"""A day, counted from 1970."""


def fill_day(store: SqliteStore, day: int, events: int) -> None:
    for index in range(events):
        store.record_event(DAY * day + 30.0 * index, "test", {"number": index, "padding": "x" * 100})
    for hour in range(24):
        store.append(DAY * day + 3600.0 * hour, {"air_temperature": Value(20.0, Quality.GOOD, 1.0)})


def publish_until(exchange: FolderExchange, day: int) -> None:
    """Publish the days before `day`, and wait for it."""
    exchange.tick(float(DAY * day + GRACE_SECONDS))
    assert exchange._task is not None
    exchange._task.result()
    assert exchange.health == ""


def published(root: Path) -> list[int]:
    """Return the sequence numbers in the files, in the order of the days."""
    files = sorted((root / "events" / "house").iterdir())
    return [json.loads(line)["sequence"] for file in files for line in gzip.open(file, "rt")]


def test_each_day_is_left_whole_and_each_record_once_also_after_a_restart(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store")
    exchange = FolderExchange(tmp_path / "exchange", "house", store)
    for day in range(FIRST_DAY, FIRST_DAY + 2):
        fill_day(store, day, 5)
        publish_until(exchange, day + 1)
    again = FolderExchange(tmp_path / "exchange", "house", store)
    fill_day(store, FIRST_DAY + 2, 5)
    publish_until(again, FIRST_DAY + 3)
    store.close()
    assert published(tmp_path / "exchange") == [record + 1 for record in range(15)]
    days = sorted((tmp_path / "exchange" / "telemetry" / "house").iterdir())
    assert [len(read_csv(day)) for day in days] == [24, 24, 24]


def peak_of_publishing(exchange: FolderExchange, day: int) -> int:
    """Return the largest memory in bytes while the days before `day` are published."""
    tracemalloc.start()
    try:
        publish_until(exchange, day)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_publishing_a_day_takes_no_more_memory_the_longer_the_ledger_is(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "store", StoreLimits(survive_power_cut=False))
    exchange = FolderExchange(tmp_path / "exchange", "house", store)
    peaks = {}
    for number, events in enumerate((20, 20, 2000, 20)):
        fill_day(store, FIRST_DAY + number, events)
        peaks[number] = peak_of_publishing(exchange, FIRST_DAY + number + 1)
    store.close()
    # All 2000 would take some 2 MB more.
    assert peaks[3] < peaks[1] + 200_000
