"""Reads a grower's export by its mapping."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local
from igrow.core.telemetry import concatenate
from igrow.trainer.data.cells import Cells, read_cells
from igrow.trainer.data.mapping import ColumnMapping, ExportMapping, TimeColumn
from igrow.trainer.data.number_texts import number
from igrow.trainer.data.rows import Merged, merge
from igrow.trainer.data.timestamps import ZONE, to_utc, wall_parser, without_weekday
from igrow.trainer.data.vocabulary import folded, month_names, words_of, zones_called
from igrow.trainer.data.zone_abbreviations import split

MOST_UNREADABLE = 0.02
"""Share of rows whose time cannot be read up to which they are no readings; beyond it the form is wrong."""
_LEAST_WIDTH = 3
"""Columns of a table in which a line of one cell is a title."""
LONGEST_INTERVAL = 7200.0
"""Seconds; what fell in a longer one is no rate."""


@dataclass(frozen=True)
class ExportTable:
    """An export's columns as texts."""

    path: Path
    columns: Mapping[str, Sequence[str]]
    """By name, (n,)."""
    lines: Sequence[int]

    def __getitem__(self, name: str) -> Sequence[str]:
        """Return one column; raises IgrowError where the export lacks it."""
        if name not in self.columns:
            raise IgrowError(f"{self.path}: no column {name!r}; it has {', '.join(self.columns)}")
        return self.columns[name]


def read(path: Path, mapping: ExportMapping) -> Merged:
    """Return the telemetry of one exported file.

    Raises:
        IgrowError: a column is not there, or a cell is no number or no time.
    """
    cells = read_cells(path, delimiter=mapping.delimiter, encoding=mapping.encoding, sheet=mapping.sheet)
    return read_table(chosen_rows(as_table(cells, mapping.header, mapping.first_row), mapping.only), mapping)


def read_table(table: ExportTable, mapping: ExportMapping) -> Merged:
    """Return the telemetry of an export's chosen rows; raises IgrowError as `read` does."""
    table, notes = readings(table, mapping.time)
    if mapping.long is not None:
        merged = _read_long(table, mapping)
    else:
        time = times(table, mapping)
        merged = merge(
            time, {name: quantity(name, table, rule, mapping, time) for name, rule in mapping.columns.items()}
        )
    return replace(merged, notes=(*notes, *merged.notes))


def read_tables(tables: Sequence[ExportTable], mapping: ExportMapping) -> Merged:
    """Return the telemetry of several tables of one layout, joined in time; raises IgrowError as `read` does."""
    parts = [read_table(chosen_rows(table, mapping.only), mapping) for table in tables]
    if len(parts) == 1:
        return parts[0]
    notes = dict.fromkeys(note for one in parts for note in one.notes)
    faults = dict.fromkeys(fault for one in parts for fault in one.faults)
    return Merged(concatenate([one.telemetry for one in parts]), tuple(notes), tuple(faults))


def as_table(cells: Cells, header: Sequence[int] = (1,), first_row: int | None = None) -> ExportTable:
    """Return the columns of cells by the names that the header lines give them.

    Names over several lines are joined by a blank; an upper line's cell stands for the empty ones after it (the merged
    cells of a workbook). A name that stands twice gets a number.
    """
    heads = [row for row, line in zip(cells.rows, cells.lines, strict=True) if line in set(header)]
    if not heads:
        raise IgrowError(f"{cells.path}: line {header[0]} with the columns' names is empty or not there")
    start = max(header) + 1 if first_row is None else first_row
    body = [(row, line) for row, line in zip(cells.rows, cells.lines, strict=True) if line >= start]
    width = max(len(row) for row in heads)
    heads = [*(_spread(row, width) for row in heads[:-1]), heads[-1]]
    names: list[str] = []
    for position in range(width):
        parts = [" ".join(row[position].split()) for row in heads if position < len(row) and row[position]]
        name = " ".join(parts)
        seen = sum(other == name or re.fullmatch(re.escape(name) + r" \(\d+\)", other) is not None for other in names)
        names.append(f"{name} ({seen + 1})" if seen and name else name)
    for row, line in body:
        if any(row[width:]):
            told = f"{len(row)} cells where the header has {width}"
            hint = "where decimals have commas, cells need another sign between them"
            raise IgrowError(f"{cells.path}:{line}: {told}: {hint}")
    columns: dict[str, Sequence[str]] = {}
    for position, name in enumerate(names):
        texts = [row[position] if position < len(row) else "" for row, _ in body]
        if name or any(texts):
            columns[name or f"column {position + 1}"] = texts
    return _without_titles(ExportTable(cells.path, columns, [line for _, line in body]))


def _spread(row: Sequence[str], width: int) -> list[str]:
    """Return a row whose empty cells have the text of the cell before them."""
    return _held([*row, *[""] * (width - len(row))])


def chosen_rows(table: ExportTable, only: Mapping[str, str]) -> ExportTable:
    """Return the rows in which columns have given texts; raises IgrowError where there is none."""
    for name, text in only.items():
        if text not in table[name]:
            there = ", ".join(sorted(set(table[name]))[:9])
            raise IgrowError(f"{table.path}: no row has {text!r} in column {name!r}; it has {there}")
        table = _rows(table, [row for row, cell in enumerate(table[name]) if cell == text])
    return table


def _without_titles(table: ExportTable) -> ExportTable:
    """Return a table without lines of one text alone, such as the title of each day's part; a date is no title."""
    if len(table.columns) < _LEAST_WIDTH:
        return table
    first, *others = table.columns.values()
    titles = {row for row, text in enumerate(first) if _is_title(text) and not any(cells[row] for cells in others)}
    return _rows(table, [row for row in range(len(first)) if row not in titles])


def _is_title(text: str) -> bool:
    word = re.match(r"[^\W\d_]+", without_weekday(text))
    return word is not None and folded(word[0]) not in month_names()


def _rows(table: ExportTable, kept: Sequence[int]) -> ExportTable:
    if len(kept) == len(table.lines):
        return table
    columns = {name: [cells[row] for row in kept] for name, cells in table.columns.items()}
    return ExportTable(table.path, columns, [table.lines[row] for row in kept])


def readings(table: ExportTable, time: TimeColumn) -> tuple[ExportTable, tuple[str, ...]]:
    """Return the rows that are readings, with notes on the others.

    A text without any digit is no time: a line of sums below the table, or its header once more; nor are the few that
    cannot be read as one, such as a month with its means. A day that stands on the first of its rows alone holds for
    those below it.
    """
    column, time_of_day = time.column, time.time_of_day
    notes: list[str] = []
    if time_of_day is not None and not all(table[column]):
        days, hours = _held(table[column]), table[time_of_day]
        filled = [day if hour else own for day, hour, own in zip(days, hours, table[column], strict=True)]
        if filled != list(table[column]):
            notes.append(f"{column!r} is empty on some rows: the day above holds there")
            table = ExportTable(table.path, {**table.columns, column: filled}, table.lines)
    texts = table[column]
    strange = [row for row, text in enumerate(texts) if text and not any(map(str.isdigit, text))]
    strange = sorted({*strange, *_unreadable(table, time, set(strange))})
    if not strange:
        return table, tuple(notes)
    where = ", ".join(f"line {table.lines[row]} ({texts[row]!r})" for row in strange[:3])
    more = f" and {len(strange) - 3} more" if len(strange) > 3 else ""
    notes.append(f"no readings, set aside: {where}{more}")
    out = set(strange)
    return _rows(table, [row for row in range(len(texts)) if row not in out]), tuple(notes)


def _unreadable(table: ExportTable, time: TimeColumn, known: Container[int]) -> list[int]:
    """Return the rows beside those known whose time cannot be read, where they are few."""
    read, wrong = wall_parser(time.format), []
    for row, text in enumerate(written_times(table, time)):
        if text and row not in known:
            try:
                read(text)
            except (ValueError, OverflowError):
                wrong.append(row)
                if len(wrong) > MOST_UNREADABLE * len(table.lines):
                    return []
    return wrong


def written_times(table: ExportTable, time: TimeColumn) -> Sequence[str]:
    """Return the texts of the times, day and hour together."""
    days = table[time.column]
    if time.time_of_day is None:
        return days
    return [f"{day} {hour}".strip() for day, hour in zip(days, table[time.time_of_day], strict=True)]


def _held(texts: Sequence[str]) -> list[str]:
    """Return texts whose empty ones have the text above."""
    held: list[str] = []
    for text in texts:
        held.append(text or (held[-1] if held else ""))
    return held


def times(table: ExportTable, mapping: ExportMapping) -> Times:
    """Return the UTC times of an export's rows; raises IgrowError with the line of the first that cannot be read."""
    rule = mapping.time
    texts = written_times(table, rule)
    empty = np.array([not text for text in texts], dtype=bool)
    written = [text for text in texts if text]
    found, wrong = to_utc(written, rule.format, rule.time_zone)
    if wrong is not None:
        line = table.lines[int(np.flatnonzero(~empty)[wrong])]
        zones = zones_called(split(written[wrong])[1]) if rule.format.endswith(ZONE) else ()
        why = f": which zone is meant, {' or '.join(zones)}? (`time_zone`)" if zones else ""
        raise IgrowError(f"{table.path}:{line}: {written[wrong]!r} is no time of the form {rule.format}{why}")
    result = np.full(len(texts), np.datetime64("NaT"), dtype="datetime64[s]")
    result[~empty] = found
    return result


def numbers(table: ExportTable, name: str, mapping: ExportMapping, words: Mapping[str, float], ours: str) -> Floats:
    """Return one column as numbers, NaN where it says that there is none; raises IgrowError with the line.

    Args:
        table: the export.
        name: of its column.
        mapping: of the export.
        words: what words of the column stand for.
        ours: the quantity that it is.
    """
    missing = frozenset(mapping.missing)
    # A word of the other language or state may come later than the file that the mapping was made from.
    known: dict[str, float] = {**dict.fromkeys(missing, float("nan")), **words}
    known_words = words_of(ours)
    values = np.empty(len(table.lines))
    for position, text in enumerate(table[name]):
        if text not in known:
            value = number(text, mapping.decimal)
            if value is None and words:
                value = known_words.get(folded(text))
            if value is None:
                where = f"{table.path}:{table.lines[position]}"
                raise IgrowError(f"{where}: {name} is {text!r}: a number or an empty cell is needed")
            known[text] = value
        values[position] = known[text]
    return values


def quantity(ours: str, table: ExportTable, rule: ColumnMapping, mapping: ExportMapping, time: Times) -> Floats:
    """Return one of our quantities from the columns that a rule names, in the registry's unit."""
    total = numbers(table, rule.column, mapping, rule.words, ours)
    for further in rule.add:
        total = total + numbers(table, further, mapping, rule.words, ours)
    if rule.amount != "rate":
        total = _rates(total, rule.amount, time, mapping.time.time_zone)
    return total * rule.scale + rule.offset


def _rates(amounts: Floats, kind: str, time: Times, time_zone: str) -> Floats:
    """Return amounts per second over the interval that ends at each row, in the rows' own order."""
    rates = np.full(len(amounts), np.nan)
    order = np.argsort(time, kind="stable")
    order = order[~np.isnat(time[order])]
    if len(order) < 2:
        return rates
    when, values = time[order], amounts[order]
    length = np.diff(when.astype(np.int64).astype(np.float64))
    length = np.concatenate([[np.median(length)], length])
    if kind != "interval":
        change = np.diff(values, prepend=np.nan)
        day = to_local(when, time_zone).astype("datetime64[D]")
        anew = np.concatenate([[False], day[1:] != day[:-1]]) if kind == "day" else change < 0.0
        values = np.where(anew, values, change)
    with np.errstate(invalid="ignore", divide="ignore"):
        rates[order] = np.where((length > 0.0) & (length <= LONGEST_INTERVAL), np.maximum(values, 0.0) / length, np.nan)
    return rates


def _read_long(table: ExportTable, mapping: ExportMapping) -> Merged:
    """Return the telemetry of an export with one reading a row."""
    assert mapping.long is not None
    names, values = np.array(table[mapping.long.name]), table[mapping.long.value]
    when = times(table, mapping)
    time = np.unique(when[~np.isnat(when)])
    columns: dict[str, Floats] = {}
    for ours, rule in mapping.columns.items():
        total = np.zeros(len(time))
        for name in (rule.column, *rule.add):
            rows = [int(row) for row in np.flatnonzero((names == name) & ~np.isnat(when))]
            if len(rows) == 0:
                there = ", ".join(sorted(set(names.tolist()))[:20])
                raise IgrowError(f"{table.path}: no row is called {name!r}; there are {there}")
            part = ExportTable(table.path, {name: [values[row] for row in rows]}, [table.lines[row] for row in rows])
            column = np.full(len(time), np.nan)
            own = ColumnMapping(name, amount=rule.amount, words=rule.words)
            column[np.searchsorted(time, when[rows])] = quantity(ours, part, own, mapping, when[rows])
            total = total + column
        columns[ours] = total * rule.scale + rule.offset
    return merge(time, columns)
