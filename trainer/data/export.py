"""Reads a grower's export by its mapping."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import named_days
from igrow.trainer.data.cells import Cells, is_workbook, read_cells, read_sheets
from igrow.trainer.data.export_table import ExportTable, as_table, chosen_rows, held, with_rows
from igrow.trainer.data.fault import DataFault
from igrow.trainer.data.mapping import ColumnMapping, ExportMapping, TimeColumn
from igrow.trainer.data.number_texts import number
from igrow.trainer.data.rows import Merged, joined, merge
from igrow.trainer.data.timestamps import ZONE, dates_alone, to_utc, wall_parser
from igrow.trainer.data.vocabulary import folded, is_total, words_of, zones_called
from igrow.trainer.data.zone_abbreviations import split

MOST_UNREADABLE = 0.02
"""Share of rows whose time cannot be read up to which they are no readings; beyond it the form is wrong."""
LONGEST_INTERVAL = 7200.0
"""Seconds; what fell in a longer one is no rate."""


def read(path: Path, mapping: ExportMapping) -> Merged:
    """Return the telemetry of one exported file.

    Raises:
        IgrowError: a column is not there, or a cell is no number or no time.
    """
    return read_tables(_tables(path, mapping), mapping)


def _tables(path: Path, mapping: ExportMapping) -> list[ExportTable]:
    """Return the table of a file: of a workbook, where no sheet is named, one for each that has all columns."""
    if mapping.sheet is None and is_workbook(path):
        found = [_columns(cells, mapping) for cells in read_sheets(path, transposed=mapping.transposed).values()]
        tables = [one for one in found if one is not None and mapping.names <= set(one.columns)]
        if tables:
            return tables
    cells = read_cells(
        path, delimiter=mapping.delimiter, encoding=mapping.encoding, sheet=mapping.sheet, transposed=mapping.transposed
    )
    return [_table(cells, mapping)]


def _table(cells: Cells, mapping: ExportMapping) -> ExportTable:
    return as_table(cells, mapping.header, mapping.first_row, day_in_name=mapping.time.column == named_days.COLUMN)


def _columns(cells: Cells, mapping: ExportMapping) -> ExportTable | None:
    try:
        return _table(cells, mapping)
    except IgrowError:
        return None


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
    return joined([read_table(chosen_rows(table, mapping.only), mapping) for table in tables])


def readings(table: ExportTable, time: TimeColumn) -> tuple[ExportTable, tuple[str, ...]]:
    """Return the rows that are readings, with notes on the others.

    A text without any digit is no time: a line of sums below the table, or its header once more; nor is one that begins
    with a word for a sum or a mean (`is_total`); nor are the few that
    cannot be read as one, such as a month with its means, and dates alone among times of day. A day that stands on the
    first of its rows alone holds for those below it.
    """
    column, time_of_day = time.column, time.time_of_day
    notes: list[str] = []
    if time_of_day is not None and not all(table[column]):
        days, hours = held(table[column]), table[time_of_day]
        filled = [day if hour else own for day, hour, own in zip(days, hours, table[column], strict=True)]
        if filled != list(table[column]):
            notes.append(f"{column!r} is empty on some rows: the day above holds there")
            table = ExportTable(table.path, {**table.columns, column: filled}, table.lines)
    texts = table[column]
    strange = [row for row, text in enumerate(texts) if text and (is_total(text) or not any(map(str.isdigit, text)))]
    strange += dates_alone(texts) if time_of_day is None else ()
    strange = sorted({*strange, *_unreadable(table, time, set(strange))})
    if not strange:
        return table, tuple(notes)
    where = ", ".join(f"line {table.lines[row]} ({texts[row]!r})" for row in strange[:3])
    more = f" and {len(strange) - 3} more" if len(strange) > 3 else ""
    notes.append(f"no readings, set aside: {where}{more}")
    out = set(strange)
    return with_rows(table, [row for row in range(len(texts)) if row not in out]), tuple(notes)


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
    """Return one column as numbers, (n,), NaN where it says that there is none; raises IgrowError with the line.

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
    """Return one of our quantities from the columns that a rule names, (n,), in our unit; raises IgrowError."""
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
    notes: dict[str, None] = {}
    faults: list[DataFault] = []
    for ours, rule in mapping.columns.items():
        total = np.zeros(len(time))
        for name in (rule.column, *rule.add):
            rows = [int(row) for row in np.flatnonzero((names == name) & ~np.isnat(when))]
            if len(rows) == 0:
                there = ", ".join(sorted(set(names.tolist()))[:20])
                raise IgrowError(f"{table.path}: no row is called {name!r}; there are {there}")
            part = ExportTable(table.path, {name: [values[row] for row in rows]}, [table.lines[row] for row in rows])
            own = ColumnMapping(name, amount=rule.amount, words=rule.words)
            merged = merge(when[rows], {ours: quantity(ours, part, own, mapping, when[rows])})
            column = np.full(len(time), np.nan)
            column[np.searchsorted(time, merged.telemetry.time)] = merged.telemetry[ours]
            total = total + column
            notes |= dict.fromkeys(merged.notes)
            faults += merged.faults
        columns[ours] = total * rule.scale + rule.offset
    return Merged(Telemetry(time, columns), tuple(notes), tuple(faults[:1]))
