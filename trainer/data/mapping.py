"""A grower's own export: one YAML file says which of its columns is which quantity, and in which unit.

    time: {column: Timestamp, format: "%d-%m-%Y %H:%M", time_zone: Europe/Amsterdam}
    delimiter: ";"
    decimal: ","
    columns:
      air_temperature: {column: "Temp kas (C)"}
      energy_screen: {column: "Doek", scale: -1, offset: 100}   # the export's 100 is open
      lamp_power: {column: "HPS", add: ["LED"], scale: 81}

A value becomes value * scale + offset. Where a quantity is spread over several columns, `add` names the further ones;
they are added before the scale is applied.
"""

from __future__ import annotations

# ruff: noqa: RUF009 - `setting` makes a dataclass field
import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from igrow.core import telemetry, yaml_schema
from igrow.core.errors import IgrowError
from igrow.core.local_time import from_local, zone
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry, Values
from igrow.core.yaml_schema import SettingError, setting


@dataclass(frozen=True)
class TimeColumn:
    """Where the time stands, and how it is written."""

    column: str = setting(default="time", help="its name in the export")
    format: str = setting(default="ISO 8601", help="ISO 8601, excel (days since 1899-12-30), or as strptime has it")
    time_zone: str = setting(default="UTC", help="IANA name of the zone of times without one")

    def __post_init__(self) -> None:
        try:
            zone(self.time_zone)
        except IgrowError as error:
            raise SettingError(str(error), "time_zone") from None


@dataclass(frozen=True)
class ColumnMapping:
    """One column of the export."""

    column: str = setting(help="its name in the export")
    scale: float = setting(default=1.0, help="factor from the export's unit to the registry's")
    offset: float = setting(default=0.0, help="added after the factor, in the registry's unit")
    add: tuple[str, ...] = setting(default=(), help="further columns, added to the first before the factor")


@dataclass(frozen=True)
class ExportMapping:
    """What a grower's export means."""

    columns: Mapping[str, ColumnMapping] = setting(help="our name -> the export's column", keys=tuple(QUANTITIES))
    time: TimeColumn = setting(default_factory=TimeColumn, help="the time")
    delimiter: str = setting(default=",", help="between cells of a CSV")
    decimal: str = setting(default=".", help="decimal sign of numbers")
    missing: tuple[str, ...] = setting(default=("", "NaN", "nan", "-", "#N/A"), help="texts that stand for no value")

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1:
            raise SettingError(f"delimiter is {self.delimiter!r}: one character is needed", "delimiter")
        if self.decimal not in {".", ","} or self.decimal == self.delimiter:
            raise SettingError(f"decimal is {self.decimal!r}: . or , is needed, and not the delimiter", "decimal")


def load(path: Path) -> ExportMapping:
    """Read a mapping file; raises SchemaError with file, line and column."""
    return yaml_schema.load(path, ExportMapping)


def read(path: Path, export: ExportMapping) -> Telemetry:
    """Return the telemetry of one exported file (CSV, gzip or not, or Parquet).

    Raises:
        IgrowError: a column is not there, or a cell is no number or no time.
    """
    if path.suffix == ".parquet":
        frame = pd.read_parquet(path)
        header = [str(name) for name in frame.columns]
        cells = {str(name): [str(cell) for cell in frame[name]] for name in frame.columns}
        lines = list(range(1, len(frame) + 1))
    else:
        header, parts, lines = telemetry.read_cells(path, export.delimiter)
        cells = {name: list(part) for name, part in zip(header, parts, strict=True)}
    further = (name for entry in export.columns.values() for name in (entry.column, *entry.add))
    for wanted in (export.time.column, *further):
        if wanted not in cells:
            raise IgrowError(f"{path}: no column {wanted!r}; it has {', '.join(header)}")
    time = _times(path, cells[export.time.column], lines, export.time)
    missing = frozenset(export.missing)

    def numbers(name: str) -> Values:
        texts = [cell.strip() for cell in cells[name]]
        if export.decimal == ",":
            texts = [text.replace(".", "").replace(",", ".") if "," in text else text for text in texts]
        return telemetry.parse_numbers(path, name, texts, lines, missing)

    columns = {}
    for ours, entry in export.columns.items():
        total = numbers(entry.column)
        for name in entry.add:
            total = total + numbers(name)
        columns[ours] = total * entry.scale + entry.offset
    there = ~np.isnat(time)
    return telemetry.from_rows(time[there], {name: values[there] for name, values in columns.items()})


def _times(path: Path, cells: list[str], lines: list[int], time: TimeColumn) -> telemetry.Times:
    local = np.empty(len(cells), dtype="datetime64[s]")
    shifts = np.zeros(len(cells), dtype="timedelta64[s]")
    aware = False
    for position, cell in enumerate(cells):
        try:
            if time.format == "excel":
                moment = datetime.datetime(1899, 12, 30) + datetime.timedelta(days=round(float(cell) * 86_400) / 86_400)
            elif time.format == "ISO 8601":
                moment = datetime.datetime.fromisoformat(cell.strip())
            else:
                moment = datetime.datetime.strptime(cell.strip(), time.format)
        except ValueError:
            where = f"{path}:{lines[position]}"
            raise IgrowError(f"{where}: {cell!r} is no time of the form {time.format}") from None
        offset = moment.utcoffset()
        if offset is not None:
            aware = True
            shifts[position] = np.timedelta64(int(offset.total_seconds()), "s")
            moment = moment.replace(tzinfo=None)
        local[position] = np.datetime64(moment, "s")
    return local - shifts if aware else from_local(local, time.time_zone)
