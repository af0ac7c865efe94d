"""A database file that is open for weeks, while somebody may take it away or put another in its place.

The system goes on writing to a file that no path leads to any more, and nothing of it would be left after the next
start.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from igrow.edge.store.database import describe, set_aside


class DatabaseFile:
    """Path and connection; whether the one still leads to the other is looked at in each `in_place`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection: sqlite3.Connection | None = None
        self._identity: tuple[int, int] | None = None
        self._reports: list[str] = []
        self.taken_away = ""
        """Empty while the file is where it belongs, else one line; what is written then is kept by the open file."""

    def use(self, connection: sqlite3.Connection) -> sqlite3.Connection:
        """Go on with a connection that was just opened, and return it."""
        self._connection, self._identity = connection, self._found()
        return connection

    def in_place(self) -> sqlite3.Connection | None:
        """Return the open connection; None where none is open, or the file was written anew and is to be opened."""
        if self._connection is not None and self._found() != self._identity:
            try:
                self._put_back(self._connection)
            except (sqlite3.Error, OSError) as error:
                self.taken_away = f"{self.path.name} was taken away or replaced: {describe(error)}"
            else:
                self._connection, self.taken_away = None, ""
                self.report(f"{self.path.name} was taken away or replaced while it was in use; written anew")
        return self._connection

    def close(self) -> None:
        """Let go of the file; it can be opened again."""
        if self._connection is not None:
            self._connection.close()
        self._connection = None

    def report(self, text: str) -> None:
        """Note what was cured, one line."""
        self._reports.append(text)

    def take_reports(self) -> list[str]:
        """Return what was cured since this was last asked for."""
        reports, self._reports = self._reports, []
        return reports

    def _found(self) -> tuple[int, int] | None:
        """Return what tells the file at the path from every other one; None where there is none, or nobody can say."""
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_dev, status.st_ino

    def _put_back(self, connection: sqlite3.Connection) -> None:
        """Write what the open file holds to its path, and close it; raises OSError, sqlite3.Error."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        partial = self.path.with_name(self.path.name + ".part")
        with closing(sqlite3.connect(partial)) as copy:
            connection.backup(copy)
        if self.path.exists():
            set_aside(self.path)
        partial.replace(self.path)
        connection.close()
        for suffix in ("-wal", "-shm"):
            # Left behind by the file that was taken away, they would be replayed into the new one.
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)
