"""Cells to columns by their names: headers over several lines, headers that come again, titles between the rows."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import Cells
from igrow.trainer.data.named_days import with_day
from igrow.trainer.data.timestamps import without_weekday
from igrow.trainer.data.vocabulary import folded, month_names

_Lines = Sequence[tuple[list[str], int]]
"""Rows with their lines."""
_LIKE_A_HEADER = 0.5
"""Share of the names from which on a row is the header once more."""
_LEAST_WIDTH = 3
"""Columns of a table in which a line of one cell is a title."""


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


def as_table(
    cells: Cells, header: Sequence[int] = (1,), first_row: int | None = None, *, day_in_name: bool = False
) -> ExportTable:
    """Return the columns of cells by the names that the header lines give them.

    Names over several lines are joined by a blank; an upper line's cell stands for the empty ones after it (the merged
    cells of a workbook). A name that stands twice gets a number. Where `day_in_name`, a column tells the day that sheet
    or file are named after.

    Raises:
        IgrowError: no header stands there, a row is wider than it, the columns change below it, or no name has a day.
    """
    heads = [row for row, line in zip(cells.rows, cells.lines, strict=True) if line in set(header)]
    if not heads:
        raise IgrowError(f"{cells.path}: line {header[0]} with the columns' names is empty or not there")
    start = max(header) + 1 if first_row is None else first_row
    body = [(row, line) for row, line in zip(cells.rows, cells.lines, strict=True) if line >= start]
    width = max(len(row) for row in heads)
    heads = [*(held([*row, *[""] * (width - len(row))]) for row in heads[:-1]), heads[-1]]
    names: list[str] = []
    for position in range(width):
        parts = [" ".join(row[position].split()) for row in heads if position < len(row) and row[position]]
        name = " ".join(parts)
        seen = sum(other == name or re.fullmatch(re.escape(name) + r" \(\d+\)", other) is not None for other in names)
        names.append(f"{name} ({seen + 1})" if seen and name else name)
    body = _in_first_order(cells.path, heads[-1], body)
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
    table = _without_titles(ExportTable(cells.path, columns, [line for _, line in body]))
    if not day_in_name:
        return table
    return ExportTable(cells.path, with_day(cells.path, cells.sheet, table.columns, table.lines), table.lines)


def _in_first_order(path: Path, names: Sequence[str], body: _Lines) -> list[tuple[list[str], int]]:
    """Return rows without headers that stand among them, each cell under the name that the last header gave it.

    Raises:
        IgrowError: a later header has other names.
    """
    wanted = sorted(filter(None, names))
    known = frozenset(wanted)
    order: Sequence[int] | None = None
    found: list[tuple[list[str], int]] = []
    for row, line in body:
        if len(wanted) >= _LEAST_WIDTH and sum(cell in known for cell in row) > _LIKE_A_HEADER * len(wanted):
            cells = list(filter(None, row))
            if sorted(cells) != wanted:
                other = next((cell for cell in cells if cell not in known), "")
                told = f"has {other!r} too" if other else "lacks some of them"
                raise IgrowError(
                    f"{path}:{line}: columns change here: this line names them anew and {told}: "
                    "put it and what follows into a file of its own"
                )
            order = None if list(row[: len(names)]) == list(names) else _places(row, names)
        found.append((row if order is None else [row[place] if place < len(row) else "" for place in order], line))
    return found


def _places(row: Sequence[str], names: Sequence[str]) -> list[int]:
    """Return where each name stands in a row, those that stand twice in their order."""
    left = list(enumerate([*row, *[""] * len(names)]))
    places = []
    for name in names:
        place = next(index for index, (_, cell) in enumerate(left) if cell == name)
        places.append(left.pop(place)[0])
    return places


def chosen_rows(table: ExportTable, only: Mapping[str, str]) -> ExportTable:
    """Return the rows in which columns have given texts; raises IgrowError where there is none."""
    for name, text in only.items():
        if text not in table[name]:
            there = ", ".join(sorted(set(table[name]))[:9])
            raise IgrowError(f"{table.path}: no row has {text!r} in column {name!r}; it has {there}")
        table = with_rows(table, [row for row, cell in enumerate(table[name]) if cell == text])
    return table


def _without_titles(table: ExportTable) -> ExportTable:
    """Return a table without lines of one text alone, such as the title of each day's part; a date is no title."""
    if len(table.columns) < _LEAST_WIDTH:
        return table
    first, *others = table.columns.values()
    titles = {row for row, text in enumerate(first) if _is_title(text) and not any(cells[row] for cells in others)}
    return with_rows(table, [row for row in range(len(first)) if row not in titles])


def _is_title(text: str) -> bool:
    word = re.match(r"[^\W\d_]+", without_weekday(text))
    return word is not None and folded(word[0]) not in month_names()


def with_rows(table: ExportTable, kept: Sequence[int]) -> ExportTable:
    """Return some rows of a table, by their positions."""
    if len(kept) == len(table.lines):
        return table
    columns = {name: [cells[row] for row in kept] for name, cells in table.columns.items()}
    return ExportTable(table.path, columns, [table.lines[row] for row in kept])


def held(texts: Sequence[str]) -> list[str]:
    """Return texts whose empty ones have the text above."""
    held: list[str] = []
    for text in texts:
        held.append(text or (held[-1] if held else ""))
    return held
