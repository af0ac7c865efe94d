"""What happened at each run of a site: one JSON object a line, appended, never rewritten."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object

NAME = "history.jsonl"
LONGEST_TAIL = 2**20
"""Bytes from the end that are read: some thousands of runs."""


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
