"""The store as the control cycle sees it: `igrow.edge.ports.Store` over two kinds of file."""

from __future__ import annotations

import shutil
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry, concatenate
from igrow.edge.earlier import Earlier
from igrow.edge.image import Value
from igrow.edge.records import AlarmRecord, WriteRecord
from igrow.edge.sentences import log_event
from igrow.edge.store.database import Synchronous, describe
from igrow.edge.store.ledger import NAMES, RESERVE_BYTES, Ledger
from igrow.edge.store.ledger_file import Record, read_after, read_newest, read_newest_event, read_newest_sequence
from igrow.edge.store.packing import Row, pack
from igrow.edge.store.telemetry_file import TelemetryFile, read_file, read_first_time, to_telemetry

TELEMETRY_FILE = "telemetry.db"
T = TypeVar("T")
DAY = 86_400.0
OLDER_IN_A_ROW = 100
"""Writes of earlier days, one after the other, after which the ledger is searched no further."""


class StoreError(IgrowError):
    """A store that cannot be read, copied or put back, and why."""


@dataclass(frozen=True)
class StoreLimits:
    """How much the store may take, and how much may be lost."""

    telemetry_bytes: int = 128 * 2**20
    """Largest telemetry file: about 25 days of 60 points every 5 s."""
    ledger_bytes: int = 32 * 2**20
    """Largest of each of the two ledger files."""
    batch_seconds: float = 60.0
    """Telemetry is committed when the rows in memory span this long."""
    batch_rows: int = 500
    """Telemetry is committed at the latest with this many rows in memory."""
    waiting_rows: int = 20_000
    """Rows kept in memory while the disk takes none; then the oldest go."""
    survive_power_cut: bool = True
    """False for a simulated plant: what a `kill -9` could lose is the same, a power cut may lose more."""


class SqliteStore:
    """The gateway's memory in one folder; implements `igrow.edge.ports.Store`.

    Safe to call from several threads; other processes read with `read_telemetry` and `read_records`.
    """

    def __init__(self, folder: Path, limits: StoreLimits | None = None) -> None:
        self.folder = folder
        self._limits = limits or StoreLimits()
        durable = self._limits.survive_power_cut
        telemetry: Synchronous = "NORMAL" if durable else "OFF"
        ledger: Synchronous = "FULL" if durable else "OFF"
        self._lock = threading.RLock()
        self._telemetry = TelemetryFile(
            folder / TELEMETRY_FILE, max_bytes=self._limits.telemetry_bytes, synchronous=telemetry
        )
        self._ledger = Ledger(folder, max_bytes=self._limits.ledger_bytes, synchronous=ledger)
        self._batch: list[Row] = []
        self._problem = ""
        self._dropped = 0
        self._report()

    def append(self, time: float, values: Mapping[str, Value]) -> None:
        """Add one row of telemetry; at most the last batch is lost by a power cut."""
        self.add(pack(time, values))

    def add(self, row: Row) -> None:
        """Add one row that is packed already."""
        with self._lock:
            self._batch.append(row)
            span = self._batch[-1].milliseconds - self._batch[0].milliseconds
            # A clock set back makes the span negative; the number of rows then bounds the batch.
            if span >= 1000 * self._limits.batch_seconds or len(self._batch) % self._limits.batch_rows == 0:
                self.flush()

    def flush(self) -> None:
        """Commit the rows in memory; where the disk takes none they stay there, within bounds."""
        with self._lock:
            if not self._batch:
                return
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                # The last free space belongs to the ledger.
                if shutil.disk_usage(self.folder).free < RESERVE_BYTES:
                    raise OSError("the disk is full")
                self._telemetry.add(self._batch)
            except (sqlite3.Error, OSError) as error:
                excess = len(self._batch) - self._limits.waiting_rows
                if excess > 0:
                    del self._batch[:excess]
                    self._dropped += excess
                lost = f", {self._dropped} lost" if self._dropped else ""
                self._problem = f"telemetry: {describe(error)}; {len(self._batch)} rows wait in memory{lost}"
            else:
                self._batch.clear()
                self._problem = ""
            self._report()

    def record_event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        """Add one event, durably, before returning."""
        with self._lock:
            self._ledger.add("event", time, {"kind": kind, "detail": dict(detail)})
            self._report()

    def record_write(self, record: WriteRecord) -> None:
        """Add one row to the ledger of writes and clamps, durably, before returning."""
        with self._lock:
            self._ledger.add("write", record.time, asdict(record))

    def record_alarm(self, record: AlarmRecord) -> None:
        """Add one alarm row, durably, before returning."""
        with self._lock:
            self._ledger.add("alarm", record.time, asdict(record))

    def record_state(self, time: float | None, content: Mapping[str, object]) -> None:
        """Add what control must know again after a restart, durably, before returning."""
        with self._lock:
            self._ledger.add("state", time, content)

    def newest_state(self) -> Mapping[str, object] | None:
        """Return what was recorded last, or None."""
        newest = self.records("state", 1)
        return newest[0].body if newest else None

    def writes_of_last_day(self, now: float | None) -> Sequence[WriteRecord]:
        """Return the rows with outcome "written" of the 24 h before `now`, oldest first.

        Without a clock (None), those of the 24 h before the newest such row. What a clock that was ahead has dated
        later counts as well.
        """
        with self._lock:
            found: list[WriteRecord] = []
            older = 0
            for record in self._written():
                now = record.time if now is None else now
                if now is not None and record.time is not None and record.time < now - DAY:
                    older += 1
                    # One old date may be that of a clock that was behind; many in a row are the day before.
                    if older >= OLDER_IN_A_ROW:
                        break
                    continue
                older = 0
                found.append(record)
                if len(found) >= 100_000:
                    break
            return found[::-1]

    def earlier(self, log_seconds: float) -> Earlier:
        """Return what an earlier run has left, with the log of so many seconds before its end; raises StoreError."""
        with self._lock:
            if why := self._ledger.unreadable:
                raise StoreError(f"{self.folder}: {why}")
            time = self._ledger.last_time()
            end = 0.0 if time is None else time + DAY
            # A day more on both sides: rows are committed before and after records are.
            wanted = log_seconds and time is not None
            log = self.telemetry(end - 2 * DAY - log_seconds, end) if wanted else concatenate([])
            return Earlier(time, self.newest_state(), self.writes_of_last_day(time), log)

    def records(self, category: str, count: int) -> list[Record]:
        """Return the newest records of one category ("event", "write", "alarm", "state"), newest first."""
        with self._lock:
            return [record for record, _ in zip(self._ledger.newest(category), range(count), strict=False)]

    def telemetry(self, start: float, end: float) -> Telemetry:
        """Return the stored values with quality good in [start, end), seconds since 1970 UTC; others are NaN."""
        low, high = round(start * 1000), round(end * 1000)
        with self._lock:
            self.flush()
            waiting = [row for row in self._batch if low <= row.milliseconds < high]
            try:
                stored = [self._telemetry.read(low, high)]
            except (sqlite3.Error, OSError):
                stored = []
            self._report()
        return concatenate([*stored, *(to_telemetry(r.names, [r.milliseconds], [r.packed]) for r in waiting)])

    @property
    def health(self) -> str:
        """Empty when all is well, else one line that says what is not."""
        return "; ".join(filter(None, (self._ledger.problem, self._problem or self._telemetry.taken_away)))

    def close(self) -> None:
        """Commit what is held and close."""
        with self._lock:
            self.flush()
            self._ledger.close()
            self._telemetry.close()

    def _written(self) -> Iterator[WriteRecord]:
        for record in self._ledger.newest("write"):
            if record.body["outcome"] == "written":
                yield WriteRecord(**record.body)  # type: ignore[arg-type]  # the body is what asdict made of one

    def _report(self) -> None:
        """Turn what the files cured by themselves into events."""
        for text in self._telemetry.take_reports() + self._ledger.take_reports():
            self._ledger.add("event", None, {"kind": "store_repaired", "detail": {"text": text}})
            log_event("store_repaired", {"text": text})


def read_telemetry(folder: Path, start: float, end: float) -> Telemetry:
    """Read the committed telemetry of a store that a daemon may be writing, from any thread or process.

    Raises StoreError where the file cannot be read.
    """
    path = folder / TELEMETRY_FILE
    try:
        return read_file(path, round(start * 1000), round(end * 1000))
    except sqlite3.Error as error:
        raise StoreError(f"{path}: the log cannot be read: {describe(error)}") from None


def first_row_time(folder: Path, start: float) -> int | None:
    """Return the whole second of the first committed row at or after `start`, None where there is none.

    Raises StoreError where the file cannot be read.
    """
    path = folder / TELEMETRY_FILE
    try:
        return read_first_time(path, round(start * 1000))
    except sqlite3.Error as error:
        raise StoreError(f"{path}: the log cannot be read: {describe(error)}") from None


def read_records(folder: Path, category: str, *, after: int = 0) -> list[Record]:
    """Read one category of the ledger of a store that a daemon may be writing, newest first.

    Only records with a sequence number above `after`. Raises StoreError where neither file can be read.
    """
    return _from_either(folder, lambda path: read_newest(path, category, after))


def read_event(folder: Path, kind: str) -> Mapping[str, Any] | None:
    """Read the detail of the newest event of one kind, None where there is none; raises StoreError."""
    found = _from_either(folder, lambda path: read_newest_event(path, kind))
    detail: Any = None if found is None else found.body["detail"]
    return detail if isinstance(detail, Mapping) else None


def read_records_after(folder: Path, after: int, most: int) -> list[Record]:
    """Read the first `most` records of all categories with a sequence number above `after`, oldest first.

    Raises StoreError where neither file can be read.
    """
    return _from_either(folder, lambda path: read_after(path, after, most))


def newest_sequence(folder: Path) -> int:
    """Return the newest record's sequence number, 0 where there is none; raises StoreError."""
    return _from_either(folder, read_newest_sequence)


def _from_either(folder: Path, read: Callable[[Path], T]) -> T:
    """Return what is read from the first of the ledger's twins that can be read."""
    problem = ""
    for name in NAMES:
        try:
            return read(folder / name)
        except sqlite3.Error as error:
            problem = f"{folder / name}: the ledger cannot be read: {describe(error)}"
    raise StoreError(problem)
