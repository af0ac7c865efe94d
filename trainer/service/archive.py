"""The archive of collected logs: Parquet by site and month, a file a day, that DuckDB and pandas read without us.

    telemetry/site=<site>/month=2026-03/2026-03-14.parquet   `time` (UTC) and quantities in the registry's units
    events/site=<site>/month=2026-03/2026-03-14.parquet      events, writes and alarms; `body` is JSON
    foreign/site=<site>/...                                  columns in units or of names that the registry lacks
    reports/<site>/<time>-<name>.json                        what became of bundles
    refused/<site>/<segment>.zip                             segments that could not be used, as they came

Adding is idempotent: a row is known by its time, a record by all that it says. So a run that was killed at any instant
is made good by running it again, and no order of arrival changes what stands there in the end. Where two rows of one
time differ, the value that was there first stays: what comes late cannot rewrite history.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry, concatenate
from igrow.core.whole_files import write_whole

ONE_DAY = np.timedelta64(1, "D")
_EVENTS = pa.schema({
    "time": pa.timestamp("ms", tz="UTC"), "sequence": pa.int64(), "category": pa.string(), "body": pa.string()
})  # fmt: skip


@dataclass(frozen=True)
class SiteLog:
    """What the archive holds of one site over some days."""

    telemetry: Telemetry
    events: tuple[Mapping[str, Any], ...]
    """In the order of their time."""
    reports: tuple[Mapping[str, Any], ...]
    """Oldest first."""
    missing_days: tuple[date, ...]
    """Days without a row between the first and the last day that have one."""
    notes: tuple[str, ...]
    """One sentence for each file that could not be read."""


class Archive:
    """The archive in one folder. Methods raise OSError for a disk that fails."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def collected(self) -> list[str]:
        """Return the names of the sites of which telemetry was collected."""
        return sorted(path.name.removeprefix("site=") for path in (self.root / "telemetry").glob("site=*"))

    def changed(self, site: str, day: date) -> int | None:
        """Return a stamp of a day's rows that changes with them, None where there are none."""
        try:
            return self._day("telemetry", site, np.datetime64(day)).stat().st_mtime_ns
        except FileNotFoundError:
            return None

    def add_telemetry(self, site: str, telemetry: Telemetry, *, kind: str = "telemetry") -> int:
        """Merge rows into their days; returns how many of their values differ from what is there and stay out."""
        conflicts = 0
        days = telemetry.time.astype("datetime64[D]")
        for day in np.unique(days):
            rows = telemetry.select(day, day + ONE_DAY)
            path = self._day(kind, site, day)
            before = _read_telemetry(path) if path.exists() else None
            if before is not None:
                conflicts += _conflicts(before, rows)
                rows = concatenate([rows, before])
                if _equal(rows, before):
                    continue
            _write(path, _telemetry_table(rows))
        return conflicts

    def add_events(self, site: str, events: Iterable[Mapping[str, Any]], otherwise: float) -> None:
        """Merge records into their days; one without a time counts to the day of `otherwise` (seconds since 1970)."""
        by_day: dict[np.datetime64, list[tuple[int | None, int, str, str]]] = {}
        for event in events:
            row = _event_row(event)
            moment = otherwise * 1000.0 if row[0] is None else row[0]
            by_day.setdefault(np.datetime64(int(moment), "ms").astype("datetime64[D]"), []).append(row)
        for day, rows in by_day.items():
            path = self._day("events", site, day)
            before = _read_events(path) if path.exists() else []
            # By sequence number; of one number, what has no time first.
            merged = sorted({*before, *rows}, key=lambda row: (row[1], row[0] is not None, row[0] or 0, *row[2:]))
            if merged != before:
                columns = list(zip(*merged, strict=True))
                arrays = [pa.array(column, field.type) for column, field in zip(columns, _EVENTS, strict=True)]
                _write(path, pa.Table.from_arrays(arrays, schema=_EVENTS))

    def add_file(self, kind: str, site: str, name: str, content: bytes) -> Path:
        """Keep a file as it came (`kind` is reports or refused)."""
        path = self.root / kind / site / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_bytes() != content:
            write_whole(path, content)
        return path

    def read(self, site: str, start: date, end: date) -> SiteLog:
        """Return what is there of the days start <= day < end; the cost does not grow with what lies before."""
        days = [start + timedelta(days=number) for number in range((end - start).days)]
        tables: dict[date, Telemetry] = {}
        events: list[Mapping[str, Any]] = []
        notes: list[str] = []
        for day in days:
            for kind in ("telemetry", "events"):
                path = self._day(kind, site, np.datetime64(day))
                if not path.exists():
                    continue
                try:
                    if kind == "telemetry":
                        tables[day] = _read_telemetry(path)
                    else:
                        events += [
                            {"sequence": sequence, "category": category, **json.loads(body)}
                            for _, sequence, category, body in _read_events(path)
                        ]
                except IgrowError as error:
                    notes.append(str(error))
        missing = tuple(day for day in days if tables and min(tables) < day < max(tables) and day not in tables)
        reports, unread = self.reports(site)
        return SiteLog(concatenate([*tables.values()]), tuple(events), tuple(reports), missing, (*notes, *unread))

    def reports(self, site: str) -> tuple[list[Mapping[str, Any]], list[str]]:
        """Return the reports on bundles, oldest first, and a sentence for each that is none."""
        found: list[Mapping[str, Any]] = []
        notes = []
        for path in sorted((self.root / "reports" / site).glob("*.json")):
            try:
                found.append(parse_object(path.read_bytes(), f"report {path.name}"))
            except IgrowError as error:
                notes.append(str(error))
        return found, notes

    def set_damaged_aside(self, site: str) -> list[Path]:
        """Rename the files of a site's days that cannot be read, so that the days can be collected anew.

        Returns where they lie then.
        """
        aside = []
        for kind in ("telemetry", "foreign", "events"):
            for path in sorted((self.root / kind / f"site={site}").glob("month=*/*.parquet")):
                try:
                    _read(path)
                except IgrowError:
                    aside.append(path.rename(path.with_suffix(".damaged")))
        return aside

    def _day(self, kind: str, site: str, day: np.datetime64) -> Path:
        text = str(day)
        return self.root / kind / f"site={site}" / f"month={text[:7]}" / f"{text}.parquet"


def _telemetry_table(rows: Telemetry) -> pa.Table:
    order = [*(name for name in QUANTITIES if name in rows), *sorted(n for n in rows.columns if n not in QUANTITIES)]
    fields = [pa.field("time", pa.timestamp("ms", tz="UTC"))]
    arrays = [pa.array(rows.time.astype("datetime64[ms]"), fields[0].type)]
    for name in order:
        unit = QUANTITIES[name].unit if name in QUANTITIES else ""
        values = rows[name].astype(np.float32)
        if np.isnan(values).all():
            continue
        fields.append(pa.field(name, pa.float32(), metadata={"unit": unit} if unit else None))
        arrays.append(pa.array(values, pa.float32(), mask=np.isnan(values)))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def _read(path: Path) -> pa.Table:
    try:
        # One file, as it is: the names of its folders are no columns of it.
        return pq.ParquetFile(path).read()
    except (OSError, pa.ArrowException) as error:
        raise IgrowError(
            f"{path}: cannot be read as Parquet ({str(error).splitlines()[0]}); put it back from a backup, or let "
            "`igrow-trainer collect SITE --again` set it aside and ask the gateway for its log once more"
        ) from None


def _read_telemetry(path: Path) -> Telemetry:
    table = _read(path)
    time = table.column("time").to_numpy().astype("datetime64[s]")
    columns = {
        name: table.column(name).to_numpy(zero_copy_only=False).astype(np.float64)
        for name in table.column_names
        if name != "time"
    }
    return Telemetry(time, columns)


def _read_events(path: Path) -> list[tuple[int | None, int, str, str]]:
    table = _read(path)
    time = table.column("time").cast(pa.int64()).to_pylist()
    others = [table.column(name).to_pylist() for name in ("sequence", "category", "body")]
    return list(zip(time, *others, strict=True))


def _event_row(event: Mapping[str, Any]) -> tuple[int | None, int, str, str]:
    """Return one record as a row; raises IgrowError where it lacks what each has."""
    time, sequence, category = event.get("time"), event.get("sequence"), event.get("category")
    if type(sequence) is not int or not 0 <= sequence < 2**63 or not isinstance(category, str):
        raise IgrowError("a record without sequence number or category")
    if not category.isascii():
        raise IgrowError(f"record {sequence}: category {category!a} is none")
    if time is not None and (not isinstance(time, int | float) or not 0 <= time < 2**33):
        raise IgrowError(f"record {sequence}: time {time!r} is no time since 1970")
    body = {key: value for key, value in event.items() if key not in ("sequence", "category")}
    return None if time is None else round(1000 * time), sequence, category, json.dumps(body, sort_keys=True)


def _conflicts(before: Telemetry, rows: Telemetry) -> int:
    _, old, new = np.intersect1d(before.time, rows.time, assume_unique=True, return_indices=True)
    different = 0
    for name in rows.columns:
        if name in before:
            a, b = before[name][old].astype(np.float32), rows[name][new].astype(np.float32)
            different += int(((a != b) & ~np.isnan(a) & ~np.isnan(b)).sum())
    return different


def _equal(a: Telemetry, b: Telemetry) -> bool:
    if len(a) != len(b):
        return False
    for name in a.columns:
        if name not in b:
            if not np.isnan(a[name]).all():
                return False
        elif not np.array_equal(a[name].astype(np.float32), b[name].astype(np.float32), equal_nan=True):
            return False
    return True


def _write(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    stream = io.BytesIO()
    pq.write_table(table, stream, compression="zstd", store_schema=False)
    write_whole(path, stream.getvalue())
