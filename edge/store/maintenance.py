"""Backup, restore and export of a store, also while a daemon is running on it (restore excepted)."""

from __future__ import annotations

import csv
import io
import json
import shutil
import sqlite3
import tarfile
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from igrow.core.telemetry import write_csv
from igrow.edge.store.ledger import NAMES
from igrow.edge.store.store import TELEMETRY_FILE, StoreError, read_records, read_telemetry

FILES = (TELEMETRY_FILE, *NAMES)
_LARGEST = 2**32


def backup(folder: Path, target: Path) -> Path:
    """Write a consistent copy of the store in `folder` to `target`, a .tar.gz file; returns it.

    Works while the daemon runs. Raises StoreError.
    """
    _require_store(folder)
    partial = target.with_name(target.name + ".part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
            with tarfile.open(partial, "w:gz") as archive:
                for name in FILES:
                    copy = Path(scratch) / name
                    _copy_database(folder / name, copy)
                    archive.add(copy, arcname=name)
            partial.replace(target)
    except (OSError, sqlite3.Error) as error:
        partial.unlink(missing_ok=True)
        raise StoreError(f"{target}: the backup failed: {error}") from None
    return target


def restore(archive: Path, folder: Path) -> None:
    """Put a backup into `folder`, which must not hold a store; the daemon must not run.

    Raises StoreError: not a backup, damaged, or a store in the way.
    """
    for name in FILES:
        # A write-ahead log that was left behind would be replayed into the restored file.
        for path in (folder / name, folder / f"{name}-wal", folder / f"{name}-shm"):
            if path.exists():
                raise StoreError(f"{path}: exists; move all of {folder} away first")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            with tarfile.open(archive, "r:gz") as source:
                members = {member.name: member for member in source if member.isreg() and member.size < _LARGEST}
                missing = [name for name in FILES if name not in members]
                if missing:
                    raise StoreError(f"{archive}: no backup of a store: it lacks {missing[0]}")
                for name in FILES:
                    # Bytes alone, under our own name: no path, link or mode of the archive's takes effect.
                    packed = source.extractfile(members[name])
                    assert packed is not None
                    with (Path(scratch) / name).open("xb") as unpacked:
                        shutil.copyfileobj(packed, unpacked)
            for name in FILES:
                _check_database(Path(scratch) / name, archive)
            for name in FILES:
                (Path(scratch) / name).rename(folder / name)
    except (OSError, EOFError, tarfile.TarError, sqlite3.Error) as error:
        raise StoreError(f"{archive}: the backup cannot be restored: {error}") from None


def export(folder: Path, target: Path, *, start: float = 0.0, end: float = 8e9) -> list[Path]:
    """Write telemetry as CSV by UTC day, and events, writes and alarms as CSV each, into the folder `target`.

    `start` and `end` are seconds since 1970 UTC. Returns the files. Raises StoreError.
    """
    _require_store(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        telemetry = read_telemetry(folder, start, end)
        written = []
        days = telemetry.time.astype("datetime64[D]")
        for day in np.unique(days):
            path = target / f"telemetry-{day}.csv.gz"
            write_csv(path, telemetry.select(day, day + np.timedelta64(1, "D")))
            written.append(path)
        for category in ("event", "write", "alarm"):
            path = target / f"{category}s.csv"
            path.write_text(_records_as_csv(folder, category, start, end))
            written.append(path)
    except (OSError, sqlite3.Error) as error:
        raise StoreError(f"{target}: the export failed: {error}") from None
    return written


def _records_as_csv(folder: Path, category: str, start: float, end: float) -> str:
    rows: list[dict[str, object]] = []
    for record in reversed(read_records(folder, category)):
        if record.time is None or start <= record.time < end:
            cells = {
                key: json.dumps(value) if isinstance(value, dict | list) else value
                for key, value in record.body.items()
            }
            moment = "" if record.time is None else f"{np.datetime64(int(record.time), 's')}Z"
            rows.append({"sequence": record.sequence, **cells, "time": moment})
    stream = io.StringIO(newline="")
    names = list(dict.fromkeys(name for row in rows for name in row)) or ["sequence", "time"]
    writer = csv.DictWriter(stream, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _require_store(folder: Path) -> None:
    for name in FILES:
        if not (folder / name).is_file():
            raise StoreError(f"{folder}: no store here: {name} is missing")


def _copy_database(source: Path, target: Path) -> None:
    with (
        closing(sqlite3.connect(f"{source.absolute().as_uri()}?mode=ro", uri=True, timeout=30.0)) as reading,
        closing(sqlite3.connect(target)) as writing,
    ):
        reading.backup(writing)


def _check_database(path: Path, archive: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        if connection.execute("PRAGMA quick_check(1)").fetchone()[0] != "ok":
            raise StoreError(f"{archive}: {path.name} inside is damaged")
