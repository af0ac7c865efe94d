"""The sheets of a workbook: those that go on where others end are one table, such as one for each day or month."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data.cells import Cells, read_sheets
from igrow.trainer.data.export_table import ExportTable
from igrow.trainer.data.importing.first_reading import first_reading
from igrow.trainer.data.importing.time_format import find_time

LARGEST_OVERLAP = 0.2
"""Share of a sheet's times that may stand in another one too, such as the midnight between two days."""


def fullest_sheet(path: Path) -> str | None:
    """Return the sheet with most cells, None where there is one alone."""
    found = read_sheets(path)
    return max(found, key=lambda name: sum(map(len, found[name].rows))) if len(found) > 1 else None


def go_on(tables: Sequence[ExportTable]) -> bool:
    """Tell whether each of several sheets has times of its own; those of one compartment each have the same."""
    time = find_time(dict(tables[0].columns))
    if time is None:
        return False
    names = [time.column, *([time.time_of_day] if time.time_of_day else [])]
    stamps = [set(zip(*(table[name] for name in names), strict=True)) for table in tables]
    return all(
        len(one & other) <= LARGEST_OVERLAP * min(len(one), len(other)) for one, other in combinations(stamps, 2)
    )


def unread(path: Path, read: Collection[str]) -> str | None:
    """Return a note on the sheets of a workbook that have readings and are not among those read."""
    left = [name for name, cells in read_sheets(path).items() if name not in read and _has_readings(cells)]
    if not left:
        return None
    alone = f"sheet {next(iter(read))!r} alone is read" if len(read) == 1 else f"{len(read)} sheets are read together"
    others = ", ".join(map(repr, left[:4])) + ", ..." * (len(left) > 4)
    return (
        f"{alone}; {others} have readings too, in other columns or of the same times: --sheet reads another; each "
        "saved as a CSV in one folder, they are read together"
    )


def _has_readings(cells: Cells) -> bool:
    try:
        first_reading(cells)
    except IgrowError:
        return False
    return True
