"""The file of packed telemetry rows: bounded, oldest days out first, salvaged when damaged."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from igrow.core.telemetry import Telemetry, concatenate, from_rows
from igrow.edge.store.database import (
    Synchronous,
    describe,
    is_damage,
    is_full,
    open_database,
    set_aside,
)
from igrow.edge.store.database_file import DatabaseFile
from igrow.edge.store.packing import Row, unpack_good

SCHEMA = """
CREATE TABLE IF NOT EXISTS layouts (layout INTEGER PRIMARY KEY, names TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS rows (milliseconds INTEGER PRIMARY KEY, layout INTEGER NOT NULL, packed BLOB NOT NULL);
"""
DAY = 86_400_000
"""Milliseconds."""
_LATEST = 2**43
"""Milliseconds since 1970, in the year 2248: beyond any row."""
_SALVAGE_TRIES = 4096
"""Ranges of time that are looked at in a damaged file."""


class TelemetryFile(DatabaseFile):
    """One SQLite file of telemetry. Methods raise sqlite3.Error for what they could not cure themselves."""

    def __init__(self, path: Path, *, max_bytes: int, synchronous: Synchronous) -> None:
        super().__init__(path)
        self._max_bytes = max_bytes
        self._synchronous: Synchronous = synchronous
        self._layouts: dict[tuple[str, ...], int] = {}

    def add(self, rows: Sequence[Row]) -> None:
        """Commit rows together; one of a time that is there already, after a clock stepped back, goes right behind it.

        The same row is not added twice, so that a commit of which nobody knows whether it was made can be repeated.
        """
        try:
            self._add(rows)
        except sqlite3.Error as error:
            if is_damage(error):
                self._start_over(error)
            elif is_full(error) and self._drop_a_day(rows[-1].milliseconds):
                pass
            else:
                self.close()
                raise
            self._add(rows)

    def read(self, start: int, end: int) -> Telemetry:
        """Return the good values with start <= milliseconds < end."""
        try:
            return _read(self._open(), start, end)
        except sqlite3.Error as error:
            if not is_damage(error):
                raise
            self._start_over(error)
            return _read(self._open(), start, end)

    def close(self) -> None:
        """Close; the next call opens again."""
        super().close()
        self._layouts = {}

    def _open(self) -> sqlite3.Connection:
        if connection := self.in_place():
            return connection
        self._layouts = {}
        try:
            return self.use(self._connect())
        except sqlite3.Error as error:
            if not is_damage(error):
                raise
            return self._start_over(error)

    def _connect(self) -> sqlite3.Connection:
        return open_database(self.path, max_bytes=self._max_bytes, synchronous=self._synchronous, schema=SCHEMA)

    def _add(self, rows: Sequence[Row]) -> None:
        connection = self._open()
        connection.execute("BEGIN IMMEDIATE")
        try:
            for row in rows:
                _insert(connection, row.milliseconds, self._layout(connection, row.names), row.packed)
            connection.execute("COMMIT")
        except BaseException:
            self._layouts = {}
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            raise
        self._keep_bounded(connection, rows[-1].milliseconds)

    def _layout(self, connection: sqlite3.Connection, names: tuple[str, ...]) -> int:
        if names not in self._layouts:
            text = json.dumps(names)
            connection.execute("INSERT OR IGNORE INTO layouts (names) VALUES (?)", (text,))
            (layout,) = connection.execute("SELECT layout FROM layouts WHERE names = ?", (text,)).fetchone()
            self._layouts[names] = layout
        return self._layouts[names]

    def _keep_bounded(self, connection: sqlite3.Connection, now: int) -> None:
        """Drop days above nine tenths of the bound, so that a commit seldom meets it."""
        (pages,) = connection.execute("PRAGMA page_count").fetchone()
        (free,) = connection.execute("PRAGMA freelist_count").fetchone()
        (page_size,) = connection.execute("PRAGMA page_size").fetchone()
        if (pages - free) * page_size > 0.9 * self._max_bytes:
            self._drop_a_day(now)

    def _drop_a_day(self, now: int) -> bool:
        """Delete a day, never that of the row of `now` (milliseconds); tell whether there was one.

        The last day of those that lie ahead, which a clock that was wrong has left, and only then the oldest one: else
        they would stay for ever, and what is measured now would be the first to go.
        """
        connection = self._open()
        oldest, newest = connection.execute("SELECT min(milliseconds), max(milliseconds) FROM rows").fetchone()
        if oldest is None:
            return False
        if newest // DAY > now // DAY + 1:
            connection.execute("DELETE FROM rows WHERE milliseconds >= ?", (newest // DAY * DAY,))
        elif oldest // DAY < now // DAY:
            connection.execute("DELETE FROM rows WHERE milliseconds < ?", ((oldest // DAY + 1) * DAY,))
        else:
            return False
        connection.execute("PRAGMA incremental_vacuum").fetchall()
        return True

    def _start_over(self, error: sqlite3.Error) -> sqlite3.Connection:
        """Set the damaged file aside and carry over what can still be read."""
        self.close()
        try:
            aside = set_aside(self.path)
        except OSError as failure:
            # A disk that refuses the rename is read-only or gone: the owner keeps rows in memory and retries.
            raise sqlite3.OperationalError(f"{self.path}: {failure.strerror}") from error
        connection = self.use(self._connect())
        saved = salvage(aside, connection)
        self.report(f"{self.path.name} was damaged ({describe(error)}); set aside as {aside.name}, {saved} rows saved")
        return connection


def read_file(path: Path, start: int, end: int) -> Telemetry:
    """Read a telemetry file that another thread or process may be writing; raises sqlite3.Error."""
    with _rows_of(path) as connection:
        return concatenate([]) if connection is None else _read(connection, start, end)


def read_first_time(path: Path, start: int) -> int | None:
    """Return the whole second of the first row at or after `start` milliseconds, or None; raises sqlite3.Error."""
    query = "SELECT min(milliseconds) FROM rows WHERE milliseconds >= ?"
    with _rows_of(path) as connection:
        found = None if connection is None else connection.execute(query, (start,)).fetchone()[0]
    return None if found is None else int(found) // 1000


@contextmanager
def _rows_of(path: Path) -> Iterator[sqlite3.Connection | None]:
    """Open a file's rows to be read, None before the first: a store makes its folder, the file and its tables."""
    if path.parent.is_dir() and not path.exists():
        yield None
        return
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        made = connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'rows'").fetchone()
        yield connection if made else None


def salvage(damaged: Path, connection: sqlite3.Connection) -> int:
    """Copy every readable row of a damaged file into an open one; returns their number.

    A range of time that cannot be read is halved again and again, so that one bad page costs its own rows only.
    """
    saved = 0
    try:
        source = sqlite3.connect(f"{damaged.absolute().as_uri()}?mode=rw", uri=True, isolation_level=None)
    except sqlite3.Error:
        return 0
    with closing(source):
        try:
            connection.executemany(
                "INSERT OR IGNORE INTO layouts VALUES (?, ?)", source.execute("SELECT layout, names FROM layouts")
            )
        except sqlite3.Error:
            return 0
        ranges, tries = [(0, _LATEST)], _SALVAGE_TRIES
        while ranges and tries > 0:
            tries -= 1
            low, high = ranges.pop()
            query = "SELECT milliseconds, layout, packed FROM rows WHERE milliseconds >= ? AND milliseconds < ?"
            try:
                rows = source.execute(query, (low, high)).fetchall()
            except sqlite3.Error:
                if high - low > 1000:
                    middle = (low + high) // 2
                    ranges += [(low, middle), (middle, high)]
                continue
            if rows:
                connection.execute("BEGIN")
                connection.executemany("INSERT OR IGNORE INTO rows VALUES (?, ?, ?)", rows)
                connection.execute("COMMIT")
                saved += len(rows)
    return saved


def _insert(connection: sqlite3.Connection, milliseconds: int, layout: int, packed: bytes) -> None:
    """Add a row at its time or, where another one stands there, at the next free millisecond."""
    while (
        connection.execute("INSERT OR IGNORE INTO rows VALUES (?, ?, ?)", (milliseconds, layout, packed)).rowcount == 0
    ):
        there = connection.execute("SELECT layout, packed FROM rows WHERE milliseconds = ?", (milliseconds,)).fetchone()
        if there == (layout, packed):
            return
        milliseconds += 1


def _read(connection: sqlite3.Connection, start: int, end: int) -> Telemetry:
    names_of = {
        layout: tuple(json.loads(names)) for layout, names in connection.execute("SELECT layout, names FROM layouts")
    }
    found: dict[int, tuple[list[int], list[bytes]]] = {}
    for milliseconds, layout, packed in connection.execute(
        "SELECT milliseconds, layout, packed FROM rows WHERE milliseconds >= ? AND milliseconds < ? ORDER BY 1",
        (start, end),
    ):
        times, blobs = found.setdefault(layout, ([], []))
        times.append(milliseconds)
        blobs.append(packed)
    return concatenate([to_telemetry(names_of[layout], *rows) for layout, rows in found.items() if layout in names_of])


def to_telemetry(names: Sequence[str], milliseconds: Sequence[int], packed: Sequence[bytes]) -> Telemetry:
    """Return rows of one layout as telemetry; polls within one second become one row."""
    values: NDArray[np.float64] = unpack_good(names, packed)
    time = (np.array(milliseconds, dtype=np.int64) // 1000).astype("datetime64[s]")
    return from_rows(time, {name: values[:, column] for column, name in enumerate(names)})
