"""The ledger of events, writes and alarms: each record on the disk, in two files, before the call returns.

The two files hold the same. A record that only one of them has (the power failed between the two commits, or
one file was damaged and set aside) is copied to the other at the next start. A reserve file keeps a little
space free, which is given up when the disk is full, so that the last thing a filling disk loses is an event.
"""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from igrow.edge.store.database import Synchronous, describe, is_damage, is_full, open_database, set_aside

SCHEMA = """
CREATE TABLE IF NOT EXISTS records (
    sequence INTEGER PRIMARY KEY, category TEXT NOT NULL, time REAL, body TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS by_category ON records (category, sequence);
"""
NAMES = ("ledger-a.db", "ledger-b.db")
RESERVE_BYTES = 2**20
LOG_PAGES = 32
"""A short write-ahead log, so that the reserve holds hundreds of events."""
WAITING = 10_000
"""Records that are kept in memory for a disk that takes none."""


@dataclass(frozen=True, slots=True)
class Record:
    """One line of the ledger."""

    sequence: int
    category: str
    """"event", "write", "alarm", or "state": what a restart must not forget, of which only the newest counts."""
    time: float | None
    """Seconds since 1970 UTC; None where the clock was not to be trusted."""
    body: Mapping[str, object]


_Line = tuple[int, str, float | None, str]


class _File:
    """One of the twins."""

    def __init__(self, path: Path, *, max_bytes: int, synchronous: Synchronous) -> None:
        self.path = path
        self._max_bytes = max_bytes
        self._synchronous: Synchronous = synchronous
        self._connection: sqlite3.Connection | None = None
        self.waiting: deque[_Line] = deque(maxlen=WAITING)
        self.problem = ""

    def open(self) -> sqlite3.Connection:
        if self._connection is None:
            self._connection = open_database(
                self.path,
                max_bytes=self._max_bytes,
                synchronous=self._synchronous,
                schema=SCHEMA,
                log_pages=LOG_PAGES,
            )
        return self._connection

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = None

    def insert(self, lines: Sequence[_Line]) -> None:
        connection = self.open()
        connection.execute("BEGIN IMMEDIATE")
        try:
            connection.executemany("INSERT OR IGNORE INTO records VALUES (?, ?, ?, ?)", lines)
            connection.execute("COMMIT")
        except BaseException:
            if connection.in_transaction:
                connection.execute("ROLLBACK")
            raise

    def prune(self) -> bool:
        """Delete the oldest tenth of the writes and states or, where there are few, of everything; tell if it could.

        The newest state stays, as there may have been nothing to note for a long time.
        """
        connection = self.open()
        newest = "sequence != (SELECT ifnull(max(sequence), 0) FROM records WHERE category = 'state')"
        for where in (f"category IN ('write', 'state') AND {newest}", newest):
            (count,) = connection.execute(f"SELECT count(*) FROM records WHERE {where}").fetchone()
            if count >= 1000:
                connection.execute(
                    f"DELETE FROM records WHERE sequence IN (SELECT sequence FROM records WHERE {where} "
                    "ORDER BY sequence LIMIT ?)",
                    (count // 10,),
                )
                connection.execute("PRAGMA incremental_vacuum").fetchall()
                return True
        return False


class Ledger:
    """The twins as one. Nothing here raises for a bad disk; `problem` tells."""

    def __init__(self, folder: Path, *, max_bytes: int, synchronous: Synchronous) -> None:
        self._files = tuple(_File(folder / name, max_bytes=max_bytes, synchronous=synchronous) for name in NAMES)
        self._reserve = folder / "reserve.bin"
        self._since_reserve = 0
        self.reports: list[str] = []
        """What was cured since the owner last emptied this list, one line each."""
        self._next = 1
        self._numbered = False
        """The files have told their last sequence number; until then numbers are provisional."""
        self._reconcile()
        self._keep_reserve()

    @property
    def problem(self) -> str:
        """Empty while at least the records are safe, else one line."""
        if all(file.problem for file in self._files):
            count = max(len(file.waiting) for file in self._files)
            return f"{count} events wait in memory: {self._files[0].problem}"
        return next((f"one copy of the events fails: {f.problem}" for f in self._files if f.problem), "")

    def add(self, category: str, time: float | None, body: Mapping[str, object]) -> None:
        """Write one record to both files."""
        line = (self._next, category, time, json.dumps(body, default=str))
        self._next += 1
        for file in self._files:
            file.waiting.append(line)
        self.flush()
        self._since_reserve += 1
        if self._since_reserve >= 500:
            self._keep_reserve()

    def flush(self) -> None:
        """Write what waits, as far as the disk takes it."""
        if not self._numbered:
            self._number()
        if self._numbered:
            for file in self._files:
                if file.waiting:
                    self._flush(file)

    def newest(self, category: str) -> Iterator[Record]:
        """Yield the records of one category, newest first; those that wait in memory are included."""
        file = min(self._files, key=lambda candidate: (bool(candidate.problem), len(candidate.waiting)))
        for line in reversed([line for line in file.waiting if line[1] == category]):
            yield _record(line)
        with suppress(sqlite3.Error):
            yield from _newest(file.open(), category)

    def last_time(self) -> float | None:
        """Return the time of the newest record that has one, as far as a file can be read."""
        for file in self._files:
            with suppress(sqlite3.Error, OSError):
                query = "SELECT time FROM records WHERE time IS NOT NULL ORDER BY sequence DESC LIMIT 1"
                line = file.open().execute(query).fetchone()
                return None if line is None else float(line[0])
        return None

    def close(self) -> None:
        """Write what waits and close."""
        self.flush()
        for file in self._files:
            file.close()

    def _flush(self, file: _File) -> None:
        for _ in range(4):
            try:
                file.insert(list(file.waiting))
            except (sqlite3.Error, OSError) as error:
                file.problem = f"{file.path.name}: {describe(error)}"
                if not self._cure(file, error):
                    file.close()
                    return
            else:
                file.waiting.clear()
                file.problem = ""
                return

    def _cure(self, file: _File, error: Exception) -> bool:
        """Do what can be done about an error; tell whether another attempt makes sense."""
        if not isinstance(error, sqlite3.Error):
            return False
        try:
            if is_damage(error):
                file.close()
                self._replace(file, error)
                return True
            if is_full(error) or shutil.disk_usage(file.path.parent).free < 65_536:
                if self._reserve.exists():
                    self._reserve.unlink()
                    return True
                return file.prune()
        except (sqlite3.Error, OSError):
            pass
        return False

    def _replace(self, file: _File, error: sqlite3.Error) -> None:
        """Set a damaged file aside and fill a new one from its twin."""
        aside = set_aside(file.path)
        (twin,) = (other for other in self._files if other is not file)
        lines = _all_lines(twin)
        file.insert(lines)
        self.reports.append(
            f"{file.path.name} was damaged ({describe(error)}); set aside as {aside.name}, "
            f"{len(lines)} records restored from {twin.path.name}"
        )

    def _reconcile(self) -> None:
        """Open both files, cure what is damaged, and give each what only the other has."""
        for file in self._files:
            try:
                file.open()
            except (sqlite3.Error, OSError) as error:
                file.problem = f"{file.path.name}: {describe(error)}"
                self._cure(file, error)
        first, second = self._files
        try:
            ends = [
                file.open().execute("SELECT count(*), total(sequence) FROM records").fetchone() for file in self._files
            ]
            if ends[0] != ends[1]:
                ours, theirs = _all_lines(first), _all_lines(second)
                first.insert(theirs)
                second.insert(ours)
        except (sqlite3.Error, OSError):
            pass  # a file that cannot be opened has set its problem above, and is tried again at each record
        self._number()

    def _number(self) -> None:
        """Learn the last sequence number from the files, and number what waits after it."""
        last = 0
        for file in self._files:
            try:
                (newest,) = file.open().execute("SELECT max(sequence) FROM records").fetchone()
                last = max(last, newest or 0)
                file.problem = ""
                self._numbered = True
            except (sqlite3.Error, OSError) as error:
                file.problem = f"{file.path.name}: {describe(error)}"
        if self._numbered:
            self._next += last
            for file in self._files:
                file.waiting = deque(
                    ((line[0] + last, line[1], line[2], line[3]) for line in file.waiting), maxlen=WAITING
                )

    def _keep_reserve(self) -> None:
        """Keep the reserve file at its size; a disk without room for it is no error here."""
        self._since_reserve = 0
        try:
            if not self._reserve.exists():
                descriptor = os.open(self._reserve, os.O_CREAT | os.O_WRONLY, 0o600)
                try:
                    os.posix_fallocate(descriptor, 0, RESERVE_BYTES)
                except OSError:
                    self._reserve.unlink()
                finally:
                    os.close(descriptor)
        except OSError:
            pass


def read_newest(path: Path, category: str, after: int = 0) -> list[Record]:
    """Read one category of a ledger file that another process may be writing, newest first.

    Only records with a sequence number above `after`. Raises sqlite3.Error.
    """
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return list(_newest(connection, category, after))


def read_after(path: Path, after: int, most: int) -> list[Record]:
    """Read the first `most` records with a sequence number above `after`, oldest first; raises sqlite3.Error."""
    query = "SELECT sequence, category, time, body FROM records WHERE sequence > ? ORDER BY sequence LIMIT ?"
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return [_record(line) for line in connection.execute(query, (after, most))]


def read_newest_sequence(path: Path) -> int:
    """Return the newest record's sequence number, 0 where there is none; raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return int(connection.execute("SELECT max(sequence) FROM records").fetchone()[0] or 0)


def _newest(connection: sqlite3.Connection, category: str, after: int = 0) -> Iterator[Record]:
    query = (
        "SELECT sequence, category, time, body FROM records WHERE category = ? AND sequence > ? ORDER BY sequence DESC"
    )
    for line in connection.execute(query, (category, after)):
        yield _record(line)


def _all_lines(file: _File) -> list[_Line]:
    return file.open().execute("SELECT sequence, category, time, body FROM records").fetchall()


def _record(line: _Line) -> Record:
    sequence, category, time, body = line
    return Record(sequence, category, time, json.loads(body))
