"""The telemetry format: a table with a time and any of the registry's quantities, in memory and as CSV.

A file is CSV, gzip where its name ends in `.gz`. Its header is `time` and names of quantities; times are ISO 8601
with their zone (`2020-01-31T12:05:00Z`), an empty cell is a missing value. Rows may stand in any order. Where
several rows share one time they become one row, in which a later row's value counts before an earlier one's.
"""

from __future__ import annotations

import csv
import datetime
import difflib
import gzip
import io
import math
import os
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.whole_files import write_whole


class TelemetryError(IgrowError):
    """A telemetry table or file that breaks the format."""


@dataclass(frozen=True, repr=False)
class Telemetry:
    """A table of quantities over time, regular or not, gaps allowed; its arrays cannot be written to.

    Raises TelemetryError where times do not strictly increase or a column's length differs from theirs.
    """

    time: Times
    """UTC, datetime64[s], strictly increasing, shape (n,)."""
    columns: Mapping[str, Floats]
    """Name of a quantity -> values in the unit of the registry, shape (n,), NaN where missing."""

    def __repr__(self) -> str:
        names = ", ".join(self.columns)
        if len(self.time) == 0:
            return f"Telemetry(empty: {names})"
        return f"Telemetry({self.time[0]} to {self.time[-1]}, {len(self.time)} rows: {names})"

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype="datetime64[s]")
        if time.ndim != 1 or np.isnat(time).any() or not (np.diff(time) > np.timedelta64(0, "s")).all():
            raise TelemetryError("the times of a telemetry table must strictly increase")
        time.flags.writeable = False
        columns: dict[str, Floats] = {}
        for name, values in self.columns.items():
            column = np.array(values, dtype=np.float64)
            if column.shape != time.shape:
                raise TelemetryError(f"column {name} has shape {column.shape}, its times have {time.shape}")
            column.flags.writeable = False
            columns[name] = column
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "columns", MappingProxyType(columns))

    def __getitem__(self, name: str) -> Floats:
        """Return the column of one quantity, shape (n,); raises TelemetryError where the table lacks it."""
        try:
            return self.columns[name]
        except KeyError:
            raise TelemetryError(f"the telemetry has no column {name}{_nearest(name, self.columns)}") from None

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.time)

    def __reduce__(self) -> tuple[type[Telemetry], tuple[Times, dict[str, Floats]]]:
        return Telemetry, (self.time, dict(self.columns))

    @property
    def step(self) -> float:
        """The median step in seconds (NaN for fewer than two rows)."""
        if len(self.time) < 2:
            return float("nan")
        return float(np.median(np.diff(self.time).astype(np.int64)))

    def select(self, start: np.datetime64 | None = None, end: np.datetime64 | None = None) -> Telemetry:
        """Return the rows with start <= time < end; None leaves that side open."""
        first = 0 if start is None else int(np.searchsorted(self.time, start.astype("datetime64[s]")))
        last = len(self.time) if end is None else int(np.searchsorted(self.time, end.astype("datetime64[s]")))
        return Telemetry(self.time[first:last], {name: column[first:last] for name, column in self.columns.items()})

    def with_columns(self, columns: Mapping[str, Floats]) -> Telemetry:
        """Return the same rows with these columns added, or put in the place of those with the same name."""
        return Telemetry(self.time, {**self.columns, **columns})

    def only(self, names: Iterable[str]) -> Telemetry:
        """Return the same rows with these columns alone, in this order; TelemetryError if one is absent."""
        return Telemetry(self.time, {name: self[name] for name in names})


def from_rows(time: Times, columns: Mapping[str, Floats]) -> Telemetry:
    """Build a table from rows in any order; rows of one time become one, in which later values win."""
    time = np.asarray(time, dtype="datetime64[s]")
    order = np.argsort(time, kind="stable")
    time = time[order]
    new = np.ones(len(time), dtype=bool)
    new[1:] = time[1:] > time[:-1]
    group = np.cumsum(new) - 1
    merged: dict[str, Floats] = {}
    for name, values in columns.items():
        ordered = np.asarray(values, dtype=np.float64)[order]
        column = np.full(int(new.sum()), np.nan)
        present = ~np.isnan(ordered)
        # An assignment with repeated indices keeps the last value, which is the rule of the format.
        column[group[present]] = ordered[present]
        merged[name] = column
    return Telemetry(time[new], merged)


def concatenate(tables: Sequence[Telemetry]) -> Telemetry:
    """Join tables in time; a column that one lacks is NaN there; a later table wins over an earlier one."""
    if not tables:
        return Telemetry(np.empty(0, dtype="datetime64[s]"), {})
    names = dict.fromkeys(name for table in tables for name in table.columns)
    return from_rows(
        np.concatenate([table.time for table in tables]),
        {
            name: np.concatenate([table.columns.get(name, np.full(len(table), np.nan)) for table in tables])
            for name in names
        },
    )


def to_grid(telemetry: Telemetry, step_seconds: int) -> Telemetry:
    """Return the table on a regular grid: each row is the mean of the values with row <= time < row + step.

    The grid lies on whole multiples of `step_seconds` since 1970-01-01T00:00Z. A cell without a value is NaN.
    Angles (unit deg) are averaged on the circle.
    """
    if step_seconds <= 0:
        raise TelemetryError(f"a grid needs a step of at least 1 s, not {step_seconds}")
    if len(telemetry) == 0:
        return telemetry
    cell = telemetry.time.astype(np.int64) // step_seconds
    first, count = int(cell[0]), int(cell[-1] - cell[0]) + 1
    index = cell - first

    def mean(values: Floats) -> Floats:
        present = ~np.isnan(values)
        number = np.bincount(index[present], minlength=count)
        total = np.bincount(index[present], weights=values[present], minlength=count)
        return np.where(number > 0, total / np.maximum(number, 1), np.nan)

    columns: dict[str, Floats] = {}
    for name, values in telemetry.columns.items():
        if name in QUANTITIES and QUANTITIES[name].unit == "deg":
            angle = np.arctan2(mean(np.sin(np.radians(values))), mean(np.cos(np.radians(values))))
            columns[name] = np.degrees(angle) % 360.0
        else:
            columns[name] = mean(values)
    time = ((first + np.arange(count)) * step_seconds).astype("datetime64[s]")
    return Telemetry(time, columns)


def read_csv(path: str | os.PathLike[str]) -> Telemetry:
    """Read a telemetry file; raises TelemetryError that says the file, the line and what would be right."""
    return from_rows(*read_rows(path))


def read_rows(path: str | os.PathLike[str]) -> tuple[Times, dict[str, Floats]]:
    """Read a telemetry file's rows in their own order: UTC times (n,), and columns by name, (n,) each.

    Raises TelemetryError as `read_csv` does.
    """
    path = Path(path)
    header, cells, lines = read_cells(path)
    if not header or header[0] != "time":
        raise TelemetryError(f"{path}:1: the first column must be time, not {header[0] if header else 'nothing'}")
    for name in header[1:]:
        if name not in QUANTITIES:
            raise TelemetryError(f"{path}:1: column {name} is no known quantity{_nearest(name, QUANTITIES)}")
    time = parse_times(path, cells[0], lines)
    numbers = zip(header[1:], cells[1:], strict=True)
    return time, {name: parse_numbers(path, name, column, lines) for name, column in numbers}


def write_csv(path: str | os.PathLike[str], telemetry: Telemetry) -> None:
    """Write a telemetry file whole or not at all (a new file that replaces the old); values have 7 digits."""
    path = Path(path)
    for name in telemetry.columns:
        if name not in QUANTITIES:
            raise TelemetryError(f"column {name} is no known quantity{_nearest(name, QUANTITIES)}")
    body = format_csv(telemetry).encode()
    # Without a time stamp inside, equal telemetry gives an equal file.
    data = gzip.compress(body, mtime=0) if path.suffix == ".gz" else body
    write_whole(path, data)


def format_csv(telemetry: Telemetry) -> str:
    """Return the table as CSV; values have 7 digits."""
    texts = [np.char.add(np.datetime_as_string(telemetry.time, unit="s"), "Z").tolist()]
    texts += [["" if math.isnan(value) else f"{value:.7g}" for value in c.tolist()] for c in telemetry.columns.values()]
    return "\n".join([",".join(["time", *telemetry.columns]), *map(",".join, zip(*texts, strict=True)), ""])


def read_cells(path: Path, delimiter: str = ",") -> tuple[list[str], list[Sequence[str]], list[int]]:
    """Return the header, the cells by column and the line number of each row of a CSV file, gzip by suffix.

    Raises TelemetryError where the file cannot be read, a row is not as long as the header, or names repeat.
    """
    try:
        data = path.read_bytes()
        data = gzip.decompress(data) if path.suffix == ".gz" else data
    except OSError as error:
        raise TelemetryError(f"{path}: cannot be read: {error.strerror or 'not a whole gzip file'}") from None
    except (EOFError, zlib.error):
        raise TelemetryError(f"{path}: the gzip file ends too early or is damaged") from None
    return parse_cells(data, path, delimiter)


def parse_cells(
    data: bytes, path: str | Path, delimiter: str = ","
) -> tuple[list[str], list[Sequence[str]], list[int]]:
    """Return the header, the cells by column and the line number of each row of CSV; `path` stands in errors."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise TelemetryError(f"{path}: is not UTF-8 text: save it as CSV in UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    try:
        return _cells(reader, path)
    except csv.Error as error:
        raise TelemetryError(f"{path}:{reader.line_num}: no CSV: {error}") from None


def _cells(reader: Any, path: str | Path) -> tuple[list[str], list[Sequence[str]], list[int]]:
    header = [name.strip() for name in next(reader, [])]
    while header and not header[-1]:
        header.pop()  # some programs end each line with delimiters
    for position, name in enumerate(header):
        if name in header[:position]:
            raise TelemetryError(f"{path}:1: column {name or '(without a name)'} stands twice")
    width = len(header)
    rows: list[list[str]] = []
    lines: list[int] = []
    for row in reader:
        if len(row) != width:
            if not any(cell.strip() for cell in row):
                continue
            if len(row) < width or any(cell.strip() for cell in row[width:]):
                raise TelemetryError(f"{path}:{reader.line_num}: {len(row)} cells where the header has {width}")
            row = row[:width]  # noqa: PLW2901
        rows.append(row)
        lines.append(reader.line_num)
    columns: list[Sequence[str]] = list(zip(*rows, strict=True)) if rows else [() for _ in header]
    return header, columns, lines


def parse_numbers(path: str | Path, name: str, cells: Sequence[str], lines: Sequence[int]) -> Floats:
    """Return one column of cells as float64; empty cells and `nan` become NaN."""
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        values = np.empty(len(cells))
        for position, cell in enumerate(cells):
            text = cell.strip()
            try:
                values[position] = float(text) if text else np.nan
            except ValueError:
                where = f"{path}:{lines[position]}"
                raise TelemetryError(f"{where}: {name} is {text!r}: a number or an empty cell is needed") from None
    if np.isinf(values).any():
        line = lines[int(np.flatnonzero(np.isinf(values))[0])]
        raise TelemetryError(f"{path}:{line}: {name} is infinite: a number or an empty cell is needed")
    return values


def parse_times(path: str | Path, cells: Sequence[str], lines: Sequence[int]) -> Times:
    """Return a column of times, UTC, of texts in ISO 8601 with a zone; that of `write_csv` is read at once.

    Raises TelemetryError with the line of one that is none.
    """
    try:
        if all(cell.endswith("Z") for cell in cells):
            time = np.array([cell[:-1] for cell in cells], dtype="datetime64[s]")
            if not np.isnat(time).any():
                return time
    except ValueError:
        pass
    seconds = np.empty(len(cells), dtype=np.int64)
    for position, (cell, line) in enumerate(zip(cells, lines, strict=True)):
        try:
            moment = datetime.datetime.fromisoformat(cell.strip())
        except ValueError:
            moment = None
        if moment is None or moment.tzinfo is None:
            raise TelemetryError(f"{path}:{line}: time is {cell!r}: a time needs the form 2020-01-31T12:05:00Z")
        seconds[position] = math.floor(moment.timestamp())
    return seconds.astype("datetime64[s]")


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint at the nearest known name, or nothing."""
    found = difflib.get_close_matches(name, list(known), n=1)
    return f": did you mean {found[0]}?" if found else ""
