"""One archive collects a site: of two trainers at one exchange each would get a part of the log, and neither all of it.

The first one that comes leaves its archive's name in the exchange, `<site>/collector.json`. A trainer that was restored
from a backup has the same name again.
"""

from __future__ import annotations

import fcntl
import json
import os
import secrets
from datetime import datetime
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.exchange import Place
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object

NAME = "collector.json"
IDENTITY = "identity"


def claim(place: Place, site: str, archive: Path, now: datetime, *, take_over: bool) -> None:
    """Make sure that this archive is the one that collects a site; with `take_over` it is from now on.

    Raises IgrowError where it is another one, ExchangeError where the exchange fails, OSError for the archive's disk.
    """
    mine, path = _identity(archive), f"{site}/{NAME}"
    there = place.get(path, LARGEST_DOCUMENT)
    if there is not None:
        try:
            other = parse_object(there, path)
        except IgrowError:
            other = {}  # cut short: whoever wrote it writes it again
        if other.get("archive") == mine:
            return
        if other.get("archive") and not take_over:
            raise IgrowError(
                f"{site}: another archive collects it here since {other.get('since')}, and two would each get a part "
                "of its log: end the other trainer, then collect once with --take-over"
            )
    place.put(path, json.dumps({"archive": mine, "since": f"{now:%Y-%m-%d}"}).encode())


def _identity(archive: Path) -> str:
    """Return the archive's name for itself, drawn once, whoever asks first."""
    with (archive / IDENTITY).open("a+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        name = file.read().strip()
        if not name:
            name = secrets.token_hex(12)
            file.write(name)
            file.flush()
            os.fsync(file.fileno())
    return name
