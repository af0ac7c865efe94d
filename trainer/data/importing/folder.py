"""A folder of exports: files of one layout, such as one for each day, and files of several, such as one a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import Cells, is_workbook, read_cells, read_sheets
from igrow.trainer.data.export_table import ExportTable, as_table
from igrow.trainer.data.importing.layout import Layout, find_layout
from igrow.trainer.data.importing.sheets import go_on

Head = list[list[str]]
"""The lines with the names and units of a file."""


def alike(paths: Sequence[Path], sheet: str | None = None) -> list[list[Path]]:
    """Return files by their layout, in the order in which the first of each comes.

    Files are alike that have the same names in the same lines, and the same units below them.

    Raises:
        IgrowError: a file that is of no known layout cannot be understood.
    """
    groups: list[tuple[Layout, Head, list[Path]]] = []
    for path in paths:
        group = next((files for layout, head, files in groups if _has_head(path, layout, head)), None)
        if group is not None:
            group.append(path)
        else:
            layout, cells = find_layout(path, sheet)
            groups.append((replace(layout, sheet=sheet), head_of(cells, layout), [path]))
    return [files for _, _, files in groups]


def cells_like(path: Path, layout: Layout, head: Head) -> dict[str, Cells]:
    """Return the cells of a file by its sheets: of a workbook, where no sheet is named, those of all with a head.

    Raises:
        IgrowError: it cannot be read so.
    """
    if is_workbook(path) and layout.sheet is None:
        found = read_sheets(path, transposed=layout.transposed)
        return {name: cells for name, cells in found.items() if head_of(cells, layout) == head}
    cells = read_cells(
        path, delimiter=layout.delimiter, encoding=layout.encoding, sheet=layout.sheet, transposed=layout.transposed
    )
    return {layout.sheet or "": cells}


def whole(path: Path, layout: Layout, cells: Cells) -> tuple[Layout, dict[str, Cells]]:
    """Return a layout for all sheets of a workbook that go on where the found one ends, and the cells by sheet."""
    every = replace(layout, sheet=None)
    found = {} if layout.sheet is None else cells_like(path, every, head_of(cells, layout))
    if len(found) < 2 or not go_on([table_of(one, layout) for one in found.values()]):
        return layout, {layout.sheet or "": cells}
    return every, found


def table_of(cells: Cells, layout: Layout) -> ExportTable:
    """Return the table of cells of a layout; raises IgrowError where they are of another one."""
    return as_table(cells, layout.header, layout.first_row, day_in_name=layout.day_in_name)


def joined(tables: Sequence[ExportTable]) -> ExportTable:
    """Return the rows of tables with the same columns under each other."""
    first = tables[0]
    if len(tables) == 1:
        return first
    columns = {name: [text for table in tables for text in table[name]] for name in first.columns}
    return ExportTable(first.path, columns, [line for table in tables for line in table.lines])


def head_of(cells: Cells, layout: Layout) -> Head:
    """Return the lines with the names and units of a file."""
    told = {*layout.header, layout.units}
    return [row for row, line in zip(cells.rows, cells.lines, strict=True) if line in told]


def _has_head(path: Path, layout: Layout, head: Head) -> bool:
    """Tell whether a file, read by a layout, has a head."""
    try:
        return any(head_of(cells, layout) == head for cells in cells_like(path, layout, head).values())
    except IgrowError:
        return False
