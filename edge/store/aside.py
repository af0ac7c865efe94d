"""The store as the daemon has it: all that touches the disk happens aside, so that no disk can hold the control cycle.

`SqliteStore` keeps its promises towards the disk; this one adds that nobody waits for a disk that hangs. A record is on
the disk before its call returns whenever the disk answers in time; while it does not, records and rows wait in memory
in their order, `health` says so, and control goes on.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from igrow.core.telemetry import Telemetry
from igrow.edge.earlier import Earlier
from igrow.edge.hand_off import PATIENCE, SHARE, HandOff, LateError
from igrow.edge.image import Value
from igrow.edge.records import AlarmRecord, WriteRecord
from igrow.edge.store.packing import pack
from igrow.edge.store.store import SqliteStore, StoreError, StoreLimits, read_event, read_telemetry

CLOSE_SECONDS = 3.0
"""How long the stop waits for what is still to be written."""
READ_SECONDS = 60.0
"""How long the daemon's own threads, never its cycle, wait until what is in memory has been committed."""


class StoreAside:
    """Implements `igrow.edge.ports.Store`: a `SqliteStore` that only one thread touches."""

    def __init__(
        self, folder: Path, limits: StoreLimits | None = None, *, patience: float = PATIENCE, share: float = SHARE
    ) -> None:
        """Open the store, which is work like any other: a disk that hangs delays the first records, not the start."""
        self.folder = folder
        self._aside = HandOff("the log", patience=patience, share=share, longest_queue=20_000)
        self._store: SqliteStore | None = None
        self._wait(lambda: self._open(limits))

    def _open(self, limits: StoreLimits | None) -> None:
        self._store = SqliteStore(self.folder, limits)

    def append(self, time: float, values: Mapping[str, Value]) -> None:
        """Add one row of telemetry; at most the last batch is lost by a power cut."""
        row = pack(time, values)
        with contextlib.suppress(LateError):
            self._aside.post(lambda: self._opened().add(row))

    def record_event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        """Add one event, durably where the disk answers in time."""
        kept = dict(detail)
        self._wait(lambda: self._opened().record_event(time, kind, kept))

    def record_write(self, record: WriteRecord) -> None:
        """Add one row to the ledger of writes and clamps, durably where the disk answers in time."""
        self._wait(lambda: self._opened().record_write(record))

    def record_alarm(self, record: AlarmRecord) -> None:
        """Add one alarm row, durably where the disk answers in time."""
        self._wait(lambda: self._opened().record_alarm(record))

    def record_state(self, time: float | None, content: Mapping[str, object]) -> None:
        """Add what control must know again after a restart, durably where the disk answers in time."""
        kept = dict(content)
        self._wait(lambda: self._opened().record_state(time, kept))

    def earlier(self, log_seconds: float) -> Future[Earlier]:
        """Begin to read what an earlier run has left; what this one records comes after it."""
        return self._aside.post(lambda: self._opened().earlier(log_seconds))

    def flush(self) -> None:
        """Commit the rows in memory; raises LateError. May wait for long: not for the control cycle."""
        done = self._aside.post(lambda: self._opened().flush())
        try:
            done.result(READ_SECONDS)
        except TimeoutError:
            raise LateError(f"{self.folder}: the disk has not answered for {READ_SECONDS:g} s") from None

    def telemetry(self, start: float, end: float) -> Telemetry:
        """Return the stored values with quality good in [start, end), seconds since 1970 UTC; others are NaN.

        Raises LateError and StoreError. May wait for long: not for the control cycle.
        """
        self.flush()
        return read_telemetry(self.folder, start, end)

    def newest_event(self, kind: str) -> Mapping[str, Any] | None:
        """Return the detail of the newest event of one kind, None where there is none.

        Raises StoreError. May wait for long: not for the control cycle.
        """
        return read_event(self.folder, kind)

    @property
    def health(self) -> str:
        """Empty when all is well, else one line that says what is not."""
        return self._aside.problem or ("" if self._store is None else self._store.health)

    def close(self) -> None:
        """Commit what is held and close; what a disk does not take in time is lost."""
        with contextlib.suppress(LateError):
            self._aside.post(lambda: self._opened().close())
        if not self._aside.close(CLOSE_SECONDS):
            raise StoreError(f"{self._aside.problem or self.folder}: {self._aside.waiting} pieces of work are lost")

    def _opened(self) -> SqliteStore:
        """Return the store, in its thread: what is handed over before it is open finds it open."""
        assert self._store is not None, "opening it is the first work of the thread"
        return self._store

    def _wait(self, work: Callable[[], None]) -> None:
        with contextlib.suppress(LateError):
            self._aside.do(work)
