"""How a grower's own export becomes telemetry: a mapping file from our names to the export's columns and units.

    delimiter: ";"
    decimal: ","
    missing: [NaN, "-"]
    time: {column: Date, format: "%d-%m-%Y %H:%M", zone: Europe/Amsterdam}
    columns:
      air_temperature: {column: Tair}
      outdoor_temperature: {column: Tout F, scale: 0.5555556, offset: -17.77778}

A value becomes `value * scale + offset`. Where one of our quantities is spread over several columns, `add` names
the further ones; they are added before the scale is applied.
"""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from igrow.core import yaml_schema
from igrow.core.local_time import from_local, zone
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry, TelemetryError, Times, Values, from_rows, parse_numbers, read_cells
from igrow.core.yaml_schema import nearest, setting

_EXCEL_EPOCH = np.datetime64("1899-12-30T00:00:00", "s")


@dataclass(frozen=True)
class TimeColumn:
    """The column with the time."""

    column: str = setting(help="name in the export")
    format: str = setting(
        default="iso", help="iso, excel (days since 1899-12-30), unix (seconds), or as %d-%m-%Y %H:%M"
    )
    zone: str = setting(default="UTC", help="time zone of the times, an IANA name")
    round_to: datetime.timedelta = setting(
        default=datetime.timedelta(seconds=1),
        low=datetime.timedelta(seconds=1),
        high=datetime.timedelta(hours=1),
        help="times are rounded to this, since a serial day is not exact",
    )


@dataclass(frozen=True)
class ValueColumn:
    """The column of one quantity, and how its unit becomes ours."""

    column: str = setting(help="name in the export")
    scale: float = setting(default=1.0, help="factor")
    offset: float = setting(default=0.0, help="added after the factor, in our unit")
    add: tuple[str, ...] = setting(default=(), help="further columns, added to the first")


@dataclass(frozen=True)
class ExportMapping:
    """A mapping file."""

    time: TimeColumn = setting(help="the time")
    columns: Mapping[str, ValueColumn] = setting(help="quantity: column", keys=QUANTITIES)
    delimiter: str = setting(default=",", help="sign between cells")
    decimal: str = setting(default=".", help="decimal sign")
    missing: tuple[str, ...] = setting(default=("NaN", "nan"), help="texts that mean a missing value")


def load_mapping(path: str | os.PathLike[str]) -> ExportMapping:
    """Read a mapping file; raises SchemaError with file, line and column."""
    return yaml_schema.load(path, ExportMapping)


def read_export(path: str | os.PathLike[str], mapping: ExportMapping) -> Telemetry:
    """Read a CSV export (gzip by suffix) into telemetry; raises TelemetryError with file and line.

    Values outside the valid range of their quantity become missing: an export holds the sensor's faults too.
    """
    path = Path(path)
    header, cells, lines = read_cells(path, mapping.delimiter)

    def column(name: str) -> Sequence[str]:
        if name not in header:
            raise TelemetryError(f"{path}:1: the export has no column {name!r}: {nearest(name, header)}")
        return cells[header.index(name)]

    def numbers(name: str) -> Values:
        texts = [text.strip() for text in column(name)]
        if mapping.decimal != ".":
            texts = [text.replace(mapping.decimal, ".") for text in texts]
        return parse_numbers(path, name, texts, lines, frozenset(mapping.missing))

    texts = [text.strip() for text in column(mapping.time.column)]
    time = _parse_time(path, texts, lines, mapping.time)
    columns: dict[str, Values] = {}
    for name, rule in mapping.columns.items():
        total = numbers(rule.column)
        for further in rule.add:
            total = total + numbers(further)
        values = total * rule.scale + rule.offset
        quantity = QUANTITIES[name]
        columns[name] = np.where((values >= quantity.low) & (values <= quantity.high), values, np.nan)
    there = ~np.isnat(time)
    return from_rows(time[there], {name: values[there] for name, values in columns.items()})


def _parse_time(path: Path, texts: Sequence[str], lines: Sequence[int], rule: TimeColumn) -> Times:
    """Return UTC times of the export's texts; NaT for a wall time that the change of clocks skipped."""
    zone(rule.zone)
    seconds = np.empty(len(texts))
    for position, text in enumerate(texts):
        try:
            seconds[position] = _seconds(text, rule.format)
        except ValueError:
            what = f"time is {text!r}: the mapping says {rule.format}"
            raise TelemetryError(f"{path}:{lines[position]}: {what}") from None
    size = rule.round_to.total_seconds()
    time: Times = (np.round(seconds / size) * size).astype(np.int64).astype("datetime64[s]")
    return time if rule.zone == "UTC" else from_local(time, rule.zone)


def _seconds(text: str, form: str) -> float:
    """Return seconds since 1970 of one text, in the zone it is written in."""
    if form == "excel":
        return float(text) * 86_400.0 + float(_EXCEL_EPOCH.astype(np.int64))
    if form == "unix":
        return float(text)
    moment = datetime.datetime.fromisoformat(text) if form == "iso" else datetime.datetime.strptime(text, form)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.UTC)
    return moment.timestamp()
