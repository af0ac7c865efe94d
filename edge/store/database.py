"""Opening SQLite the way this gateway wants it, and telling its errors apart."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Literal

Synchronous = Literal["FULL", "NORMAL", "OFF"]

_DAMAGED = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}
_FULL = {sqlite3.SQLITE_FULL}


def open_database(
    path: Path, *, max_bytes: int, synchronous: Synchronous, schema: str, log_pages: int = 1000
) -> sqlite3.Connection:
    """Open or create a database with write-ahead log, bounded size and incremental vacuum.

    `log_pages` is the length at which the write-ahead log is worked into the file.
    After an end that was not clean (a write-ahead log is left) the file is checked first.
    Raises sqlite3.DatabaseError; `is_damage` and `is_full` tell what kind.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unclean = path.with_name(path.name + "-wal").exists()
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=5.0)
    try:
        # auto_vacuum must come before the journal mode, else it stays off.
        connection.execute("PRAGMA auto_vacuum=INCREMENTAL")
        connection.execute("PRAGMA journal_mode=WAL")
        # These two are forgotten at each close, so they are set at each open.
        connection.execute(f"PRAGMA synchronous={synchronous}")
        (page_size,) = connection.execute("PRAGMA page_size").fetchone()
        connection.execute(f"PRAGMA max_page_count={max(64, max_bytes // page_size)}")
        # Rows go in at the end and are seldom read; the 2 MB each that SQLite would fill over weeks buy nothing.
        connection.execute("PRAGMA cache_size=-256")
        connection.execute(f"PRAGMA wal_autocheckpoint={log_pages}")
        connection.execute(f"PRAGMA journal_size_limit={log_pages * page_size}")
        if unclean and (problem := connection.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
            raise damage(problem.splitlines()[-1])  # the first line only names the database
        connection.executescript(schema)
    except BaseException:
        connection.close()
        raise
    return connection


def damage(text: str) -> sqlite3.DatabaseError:
    """Return the error that SQLite raises for a corrupt file, for a fault that we found ourselves."""
    error = sqlite3.DatabaseError(text)
    error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
    return error


def is_damage(error: sqlite3.Error) -> bool:
    """Tell whether the file is corrupt (the cure: set it aside)."""
    # sqlite3 itself raises a few errors that carry no code, when a stored value is not what its type says.
    return _primary_code(error) in _DAMAGED


def is_full(error: sqlite3.Error) -> bool:
    """Tell whether the disk, or the file's own bound, is full (the cure: make room)."""
    return _primary_code(error) in _FULL


def describe(error: Exception) -> str:
    """Return an error as the end of a line for people."""
    return str(error) or type(error).__name__


def set_aside(path: Path) -> Path:
    """Rename a corrupt database and its companions; the two newest such files are kept.

    Returns the new name, numbered so that it needs no clock. Raises OSError.
    """
    earlier = sorted(path.parent.glob(f"{path.name}.corrupt-*[0-9]"), key=_number)
    aside = path.with_name(f"{path.name}.corrupt-{_number(earlier[-1]) + 1 if earlier else 1}")
    path.rename(aside)
    for suffix in ("-wal", "-shm"):
        companion = path.with_name(path.name + suffix)
        if companion.exists():
            companion.rename(aside.with_name(aside.name + suffix))
    for old in earlier[:-1]:
        for suffix in ("", "-wal", "-shm"):
            old.with_name(old.name + suffix).unlink(missing_ok=True)
    return aside


def _number(path: Path) -> int:
    return int(path.name.rsplit("-", 1)[1])


def _primary_code(error: sqlite3.Error) -> int:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF
