"""The exchange as the trainer sees it: the log that a gateway left there, and its reports on bundles."""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from igrow.core.telemetry import Telemetry, TelemetryError, concatenate, read_csv
from igrow.trainer.publishing.keys import PublishingError


@dataclass(frozen=True)
class ExchangeLog:
    """What one site has left."""

    telemetry: Telemetry
    events: tuple[Mapping[str, object], ...]
    """Events, writes and alarms, in the order in which they were recorded."""
    reports: tuple[Mapping[str, object], ...]
    """What became of the bundles that were published, oldest first."""
    skipped: tuple[str, ...]
    """One line for each file that could not be read; it may still be on its way."""


def read_exchange(root: Path, site: str, *, start: date | None = None, end: date | None = None) -> ExchangeLog:
    """Read the days of one site with start <= day < end; None leaves that side open.

    Raises PublishingError where the exchange knows no such site.
    """
    folder = root / "telemetry" / site
    if not folder.is_dir():
        known = sorted(path.name for path in (root / "telemetry").glob("*") if path.is_dir())
        hint = f"; it has {', '.join(known)}" if known else ""
        raise PublishingError(f"{root}: no telemetry of site {site}{hint}")
    skipped: list[str] = []
    tables = []
    for path in _days(folder, ".csv.gz", start, end):
        try:
            tables.append(read_csv(path))
        except TelemetryError as error:
            skipped.append(str(error))
    events: list[Mapping[str, object]] = []
    for path in _days(root / "events" / site, ".jsonl.gz", start, end):
        try:
            events.extend(json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines())
        except (OSError, EOFError, zlib.error, ValueError) as error:
            skipped.append(f"{path}: {error}")
    reports = []
    for path in sorted((root / "reports" / site).glob("*.json")):
        try:
            reports.append(json.loads(path.read_text()))
        except (OSError, ValueError) as error:
            skipped.append(f"{path}: {error}")
    return ExchangeLog(concatenate(tables), tuple(events), tuple(reports), tuple(skipped))


def _days(folder: Path, suffix: str, start: date | None, end: date | None) -> list[Path]:
    found = []
    for path in sorted(folder.glob(f"*{suffix}")):
        try:
            day = date.fromisoformat(path.name.removesuffix(suffix))
        except ValueError:
            continue  # not a segment: somebody's own file
        if (start is None or day >= start) and (end is None or day < end):
            found.append(path)
    return found
