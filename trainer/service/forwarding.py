"""Collected logs into a database that people have: InfluxDB by its line protocol, PostgreSQL or TimescaleDB by SQL.

A target is an address or a file:

    http://host:8086/write?db=greenhouse                    InfluxDB 1
    http://host:8086/api/v2/write?org=o&bucket=b            InfluxDB 2; its token stands in INFLUX_TOKEN
    postgresql://user@host/database                         a hypertable where TimescaleDB is installed
    greenhouse.lp, greenhouse.sql                           the same text, into a file

Writing the same again changes nothing on either, so what was cut off is simply written again. Days that were forwarded
and have not changed since are left out.
"""

from __future__ import annotations

import http.client
import json
import math
import os
import urllib.error
import urllib.request
from collections.abc import Iterator
from datetime import date, timedelta
from hashlib import sha256
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError, first_line
from igrow.core.exchange.documents import read_object
from igrow.core.telemetry import Telemetry
from igrow.core.whole_files import write_whole
from igrow.trainer.given import installed
from igrow.trainer.service.archive import Archive

MEASUREMENT = "greenhouse"
DAYS = 400
"""How far back days are looked at."""
BATCH = 5000
TIMEOUT_SECONDS = 60.0
CREATE_TABLE = """CREATE TABLE IF NOT EXISTS telemetry (
    time timestamptz NOT NULL, site text NOT NULL, quantity text NOT NULL, value real NOT NULL,
    PRIMARY KEY (site, quantity, time)
)"""
INSERT = (
    "INSERT INTO telemetry (time, site, quantity, value) VALUES (%s, %s, %s, %s) "
    "ON CONFLICT (site, quantity, time) DO UPDATE SET value = EXCLUDED.value"
)
_HYPERTABLE = "SELECT create_hypertable('telemetry', 'time', if_not_exists => TRUE, migrate_data => TRUE)"


def forward(archive: Archive, site: str, target: str, today: date) -> tuple[int, int]:
    """Write the days of a site that are new or changed to a target; returns how many they were, and their values.

    Raises IgrowError where the target refuses them; they follow at the next call.
    """
    marks_file = archive.root / "ledger" / f"{site}.forwarded-{sha256(target.encode()).hexdigest()[:12]}.json"
    marks = read_object(marks_file)
    days = values = 0
    for number in range(DAYS):
        day = today - timedelta(days=number)
        stamp = archive.changed(site, day)
        if stamp is None or marks.get(str(day)) == stamp:
            continue
        rows = archive.read(site, day, day + timedelta(days=1)).telemetry
        values += _write(target, site, rows)
        days += 1
        marks[str(day)] = stamp
        oldest = str(today - timedelta(days=DAYS))
        write_whole(marks_file, json.dumps({key: mark for key, mark in marks.items() if key >= oldest}).encode())
    return days, values


def line_protocol(site: str, rows: Telemetry) -> Iterator[str]:
    """Yield the lines of InfluxDB's protocol: one a row, times in seconds."""
    names = list(rows.columns)
    table = np.column_stack([rows[name] for name in names]) if names else np.empty((len(rows), 0))
    present = ~np.isnan(table)
    for moment, values, there in zip(
        rows.time.astype(np.int64).tolist(), table.tolist(), present.tolist(), strict=True
    ):
        fields = ",".join(
            f"{_key(name)}={value:.7g}" for name, value, known in zip(names, values, there, strict=True) if known
        )
        if fields:
            yield f"{MEASUREMENT},site={_key(site)} {fields} {moment}"


def sql_rows(site: str, rows: Telemetry) -> Iterator[tuple[str, str, str, float]]:
    """Yield time, site, quantity and value, one a measured value."""
    times = np.datetime_as_string(rows.time, unit="s").tolist()
    for name, column in rows.columns.items():
        for moment, value in zip(times, column.tolist(), strict=True):
            if not math.isnan(value):
                yield f"{moment}Z", site, name, value


def _write(target: str, site: str, rows: Telemetry) -> int:
    count = int(sum((~np.isnan(column)).sum() for column in rows.columns.values()))
    if target.startswith(("http://", "https://")):
        lines = list(line_protocol(site, rows))
        for begin in range(0, len(lines), BATCH):
            _post(target, "\n".join(lines[begin : begin + BATCH]).encode())
    elif target.startswith(("postgresql://", "postgres://")):
        _insert(target, site, rows)
    elif target.endswith(".lp"):
        _append(Path(target), "".join(line + "\n" for line in line_protocol(site, rows)))
    elif target.endswith(".sql"):
        _append(Path(target), _script(site, rows))
    else:
        raise IgrowError(f"{target}: http://..., postgresql://..., or a file that ends in .lp or .sql is right")
    return count


def _post(url: str, body: bytes) -> None:
    separator = "&" if "?" in url else "?"
    request = urllib.request.Request(f"{url}{separator}precision=s", data=body, method="POST")
    if token := os.environ.get("INFLUX_TOKEN"):
        request.add_header("Authorization", f"Token {token}")
    try:
        with urllib.request.urlopen(request, timeout=TIMEOUT_SECONDS):
            pass  # taken; whatever else is answered is not read, as it may be endless
    except urllib.error.HTTPError as error:
        raise IgrowError(
            f"{url}: refused with {error.code}: {error.read(300).decode(errors='replace').strip()}"
        ) from None
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise IgrowError(f"{url}: {getattr(error, 'reason', error)}") from None


def _insert(target: str, site: str, rows: Telemetry) -> None:
    psycopg = installed("psycopg", "postgresql", "postgresql://")
    try:
        with psycopg.connect(target, connect_timeout=20) as connection, connection.cursor() as cursor:
            cursor.execute(CREATE_TABLE)
            cursor.execute("SELECT 1 FROM pg_extension WHERE extname = 'timescaledb'")
            if cursor.fetchone() is not None:
                cursor.execute(_HYPERTABLE)
            cursor.executemany(INSERT, sql_rows(site, rows))
    except psycopg.Error as error:
        raise IgrowError(f"{target.rsplit('@', 1)[-1]}: {first_line(error)}") from None


def _script(site: str, rows: Telemetry) -> str:
    values = [f"('{moment}', '{place}', '{name}', {value:.7g})" for moment, place, name, value in sql_rows(site, rows)]
    statements = [CREATE_TABLE + ";\n"]
    head, tail = INSERT.split("(%s, %s, %s, %s)")
    for begin in range(0, len(values), BATCH):
        statements.append(head + ",\n".join(values[begin : begin + BATCH]) + tail + ";\n")
    return "".join(statements)


def _append(path: Path, text: str) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(text)


def _key(text: str) -> str:
    """Return a name as the line protocol wants it."""
    return text.replace("\\", "\\\\").replace(",", "\\,").replace("=", "\\=").replace(" ", "\\ ")
