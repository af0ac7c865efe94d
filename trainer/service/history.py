"""What happened at each run of a site: one JSON object a line, appended, never rewritten."""

from __future__ import annotations

import json
import os
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object

NAME = "history.jsonl"
LONGEST_TAIL = 2**20
"""Bytes from the end that are read: some thousands of runs."""


@dataclass(frozen=True)
class Turn:
    """What one run did for one site: a line of its history."""

    command: str
    site: str
    time: datetime
    verdict: str
    published: bool
    note: str
    causes: tuple[str, ...] = ()
    gain: float = 0.0
    """Relative fall of the 24 h error on unseen days against the bundle in force."""
    notes: tuple[str, ...] = ()
    """What was set aside or is missing, one sentence each."""

    def to_json(self) -> dict[str, Any]:
        """Return the line of the history."""
        return asdict(self) | {"time": self.time.strftime("%Y-%m-%dT%H:%M:%SZ"), "gain": round(self.gain, 4)}


def keep(folder: Path, command: str, site: str, now: datetime, work: Callable[[], Turn]) -> Turn:
    """Return what a run came to, and keep it; what fails in it, and a fault of this program, are a line of the history.

    Raises MemoryError, and OSError where the history cannot be written.
    """
    try:
        turn = work()
    except (IgrowError, OSError) as error:
        turn = Turn(command, site, now, "error", False, str(error))
    except MemoryError:
        raise  # whoever gave the limit says so
    except Exception as error:  # a fault of ours in one site's data must not cost the others
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "fault.txt").write_text(traceback.format_exc(), encoding="utf-8")
        what = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
        note = f"a fault of this program: {what}; see {folder / 'fault.txt'}"
        turn = Turn(command, site, now, "error", False, note)
    append(folder, turn.to_json())
    return turn


def append(folder: Path, line: Mapping[str, Any]) -> None:
    """Add one line, durably; one that a kill cut short before it stays on its own. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / NAME).open("a+b") as file:
        size = file.seek(0, os.SEEK_END)
        if size:
            file.seek(size - 1)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write(json.dumps(dict(line)).encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def read(folder: Path) -> list[dict[str, Any]]:
    """Return the lines that can be read, oldest first; a line that was cut short counts for nothing."""
    path = folder / NAME
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - LONGEST_TAIL))
            data = file.read()
    except FileNotFoundError:
        return []
    found = []
    for line in data.splitlines():
        try:
            entry = parse_object(line, str(path))
            entry["time"] = _moment(entry).strftime("%Y-%m-%dT%H:%M:%SZ")
        except IgrowError:
            continue
        found.append(entry)
    return found


def last_success(lines: list[dict[str, Any]], command: str) -> datetime | None:
    """Return when `command` last came to an end that was no error; an error is no reason to wait."""
    for line in reversed(lines):
        if line.get("command") == command and line.get("verdict") != "error":
            return _moment(line)
    return None


def _moment(line: Mapping[str, Any]) -> datetime:
    try:
        moment = datetime.fromisoformat(str(line["time"]))
    except (KeyError, ValueError):
        raise IgrowError("a line of a history without a time") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
