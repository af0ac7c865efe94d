"""Exports with one reading a row: which column names what was read, which is the reading, and which its unit."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from igrow.trainer.data import vocabulary
from igrow.trainer.data.export_table import ExportTable
from igrow.trainer.data.importing import columns as names
from igrow.trainer.data.importing.texts import column_texts
from igrow.trainer.data.mapping import LongTable

_MOST_COLUMNS, _MOST_NAMES = 12, 500


def find_long(table: ExportTable, time: Collection[str | None], decimal: str) -> LongTable | None:
    """Return the columns of name and value of an export with one reading a row, or None for any other.

    Args:
        table: the export.
        time: its columns of the time.
        decimal: sign before decimals.
    """
    others = [name for name in table.columns if name not in time]
    if len(others) > _MOST_COLUMNS:
        return None
    for name in others:
        labels = set(table[name])
        if not 2 <= len(labels) <= _MOST_NAMES or len(labels) > 0.5 * len(table.lines):
            continue
        # Numbers name nothing: asked first, since the words of many names take long.
        if column_texts(table[name], decimal).numeric >= 0.2:
            continue
        told = {match.quantity for match in names.find_matches(labels, {})}
        value = _value([one for one in others if one != name], table, decimal)
        if len(told) >= 2 and value is not None:
            return LongTable(name, value)
    return None


def _value(others: Sequence[str], table: ExportTable, decimal: str) -> str | None:
    """Return the column of the readings: the one that is called so, else the one whose numbers differ most.

    A number of the row, a code of quality and the number of a compartment are none.
    """
    numeric = [one for one in others if column_texts(table[one], decimal).numeric > 0.8]
    counted = [one for one in numeric if len(set(table[one])) < len(table.lines)]
    return max(counted, key=lambda one: (vocabulary.is_value(one), len(set(table[one]))), default=None)


def units_beside(table: ExportTable, long: LongTable) -> dict[str, str]:
    """Return name -> unit, where a column tells one unit for each name."""
    for column in table.columns:
        if column in (long.name, long.value):
            continue
        pairs = set(zip(table[long.name], table[column], strict=True))
        units = dict(pairs)
        known = [text for text in units.values() if vocabulary.find_units([vocabulary.compact(text)])]
        if len(units) == len(pairs) and 2 * len(known) > len(units):
            return units
    return {}
