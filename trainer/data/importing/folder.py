"""A folder of exports: files of one layout, such as one for each day, and files of several, such as one a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import Cells, read_cells
from igrow.trainer.data.export_table import ExportTable
from igrow.trainer.data.importing.layout import Layout, find_layout


def alike(paths: Sequence[Path], sheet: str | None = None) -> list[list[Path]]:
    """Return files by their layout, in the order in which the first of each comes.

    Files are alike that have the same names in the same lines, and the same units below them.

    Raises:
        IgrowError: a file that is of no known layout cannot be understood.
    """
    groups: list[tuple[Layout, list[list[str]], list[Path]]] = []
    for path in paths:
        group = next((files for layout, head, files in groups if _head(path, layout) == head), None)
        if group is not None:
            group.append(path)
        else:
            layout, cells = find_layout(path, sheet)
            groups.append((layout, _lines(cells, layout), [path]))
    return [files for _, _, files in groups]


def further_cells(paths: Sequence[Path], layout: Layout) -> Iterator[Cells]:
    """Yield the cells of files of one layout."""
    for path in paths:
        yield read_cells(
            path,
            delimiter=layout.delimiter,
            encoding=layout.encoding,
            sheet=layout.sheet,
            transposed=layout.transposed,
        )


def joined(tables: Sequence[ExportTable]) -> ExportTable:
    """Return the rows of tables with the same columns under each other."""
    first = tables[0]
    if len(tables) == 1:
        return first
    columns = {name: [text for table in tables for text in table[name]] for name in first.columns}
    return ExportTable(first.path, columns, [line for table in tables for line in table.lines])


def _head(path: Path, layout: Layout) -> list[list[str]] | None:
    """Return the lines with the names of a file, where it is read by a layout; None where it cannot be."""
    try:
        return _lines(next(further_cells([path], layout)), layout)
    except IgrowError:
        return None


def _lines(cells: Cells, layout: Layout) -> list[list[str]]:
    told = {*layout.header, layout.units}
    return [row for row, line in zip(cells.rows, cells.lines, strict=True) if line in told]
