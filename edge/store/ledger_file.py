"""One file of the ledger: its lines, how the oldest of them go, and how other processes read it."""

from __future__ import annotations

import json
import sqlite3
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from igrow.edge.store.database import Synchronous, open_database
from igrow.edge.store.database_file import DatabaseFile

SCHEMA = """
CREATE TABLE IF NOT EXISTS records (
    sequence INTEGER PRIMARY KEY, category TEXT NOT NULL, time REAL, body TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS by_category ON records (category, sequence);
"""
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


Line = tuple[int, str, float | None, str]


class LedgerFile(DatabaseFile):
    """One of the twins."""

    def __init__(self, path: Path, *, max_bytes: int, synchronous: Synchronous) -> None:
        super().__init__(path)
        self._max_bytes = max_bytes
        self._synchronous: Synchronous = synchronous
        self.waiting: deque[Line] = deque(maxlen=WAITING)
        self.problem = ""

    def open(self) -> sqlite3.Connection:
        """Return the connection; raises sqlite3.Error, OSError."""
        return self.in_place() or self.use(
            open_database(
                self.path,
                max_bytes=self._max_bytes,
                synchronous=self._synchronous,
                schema=SCHEMA,
                log_pages=LOG_PAGES,
            )
        )

    def number_after(self, last: int) -> None:
        """Move the numbers of what waits behind those that the files have."""
        moved = ((number + last, category, time, body) for number, category, time, body in self.waiting)
        self.waiting = deque(moved, maxlen=WAITING)

    def insert(self, lines: Sequence[Line]) -> None:
        """Add the lines that the file does not have, all or none; raises sqlite3.Error, OSError."""
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


def read_newest(path: Path, category: str, after: int = 0) -> list[Record]:
    """Read one category of a ledger file that another process may be writing, newest first.

    Only records with a sequence number above `after`. Raises sqlite3.Error.
    """
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return list(newest_in(connection, category, after))


def read_newest_event(path: Path, kind: str) -> Record | None:
    """Read the newest event of one kind of a ledger file that another process may be writing; raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return next((one for one in newest_in(connection, "event") if one.body["kind"] == kind), None)


def read_after(path: Path, after: int, most: int) -> list[Record]:
    """Read the first `most` records with a sequence number above `after`, oldest first; raises sqlite3.Error."""
    query = "SELECT sequence, category, time, body FROM records WHERE sequence > ? ORDER BY sequence LIMIT ?"
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return [record_of(line) for line in connection.execute(query, (after, most))]


def read_newest_sequence(path: Path) -> int:
    """Return the newest record's sequence number, 0 where there is none; raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)) as connection:
        return int(connection.execute("SELECT max(sequence) FROM records").fetchone()[0] or 0)


def newest_in(connection: sqlite3.Connection, category: str, after: int = 0) -> Iterator[Record]:
    """Yield the records of one category of an open file, newest first."""
    query = (
        "SELECT sequence, category, time, body FROM records WHERE category = ? AND sequence > ? ORDER BY sequence DESC"
    )
    for line in connection.execute(query, (category, after)):
        yield record_of(line)


def all_lines(file: LedgerFile) -> list[Line]:
    """Return everything that a file holds; raises sqlite3.Error."""
    return file.open().execute("SELECT sequence, category, time, body FROM records").fetchall()


def record_of(line: Line) -> Record:
    """Return what a line says."""
    sequence, category, time, body = line
    return Record(sequence, category, time, json.loads(body))
