"""Rows and files that the store's tests share, and the child process that they kill."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from igrow.edge.image import Quality, Value
from igrow.edge.records import WriteRecord
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.edge.store.ledger_file import Record

START = 1_780_000_000.0


def values(temperature: float, quality: Quality = Quality.GOOD) -> dict[str, Value]:
    """Return a poll of two points."""
    return {
        "air_temperature": Value(temperature, quality, 1.0),
        "air_humidity": Value(80.0, Quality.GOOD, 1.0),
    }


def write_record(time: float | None, outcome: str = "written") -> WriteRecord:
    return WriteRecord(time, 1.0, "heating_setpoint", 18.0, 18.0, "recipe", "", outcome)


def number_of(record: Record) -> object:
    """Return the number in the detail of an event."""
    detail = record.body["detail"]
    assert isinstance(detail, Mapping)
    return detail["number"]


def write_until_killed(folder: Path) -> None:
    """Append rows and events for ever, printing the number of each once the store has taken it."""
    store = SqliteStore(folder, StoreLimits(batch_seconds=50.0))
    row = len(store.telemetry(0.0, 8e9))
    # Rows that a kill took leave no gap here: the count goes on from what was found.
    event = len(store.records("event", 10**9))
    print(f"open {row} {event}", flush=True)
    while True:
        store.append(START + 5.0 * row, values(20.0 + row % 7))
        row += 1
        sys.stdout.write(f"row {row}\n")
        if row % 3 == 0:
            store.record_event(START + 5.0 * row, "test", {"number": event})
            event += 1
            sys.stdout.write(f"event {event}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    write_until_killed(Path(sys.argv[1]))
