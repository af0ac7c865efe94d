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
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from igrow.edge.store.database import Synchronous, describe, is_damage, is_full, set_aside
from igrow.edge.store.ledger_file import LedgerFile, Record, all_lines, newest_in, record_of

NAMES = ("ledger-a.db", "ledger-b.db")
RESERVE_BYTES = 2**20


class Ledger:
    """The twins as one. Nothing here raises for a bad disk; `problem` tells."""

    def __init__(self, folder: Path, *, max_bytes: int, synchronous: Synchronous) -> None:
        self._files = tuple(LedgerFile(folder / name, max_bytes=max_bytes, synchronous=synchronous) for name in NAMES)
        self._reserve = folder / "reserve.bin"
        self._since_reserve = 0
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
        problems = (file.problem or file.taken_away for file in self._files)
        return next((f"one copy of the events fails: {problem}" for problem in problems if problem), "")

    @property
    def unreadable(self) -> str:
        """Empty where what was noted before can be read, or nothing was; else one line."""
        if not all(file.problem for file in self._files):
            return ""
        try:
            there = any(file.path.exists() for file in self._files)
        except OSError:
            there = True
        return self._files[0].problem if there else ""

    def take_reports(self) -> list[str]:
        """Return what was cured since this was last asked for, one line each."""
        return [text for file in self._files for text in file.take_reports()]

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
            yield record_of(line)
        with suppress(sqlite3.Error, OSError):
            yield from newest_in(file.open(), category)

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

    def _flush(self, file: LedgerFile) -> None:
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

    def _cure(self, file: LedgerFile, error: Exception) -> bool:
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

    def _replace(self, file: LedgerFile, error: sqlite3.Error) -> None:
        """Set a damaged file aside and fill a new one from its twin."""
        aside = set_aside(file.path)
        (twin,) = (other for other in self._files if other is not file)
        lines = all_lines(twin)
        file.insert(lines)
        file.report(
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
                ours, theirs = all_lines(first), all_lines(second)
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
                file.number_after(last)

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
