"""Where the readings of a table begin; and where they do not, what is odd about it and what would be right."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence

from igrow.core.errors import IgrowError
from igrow.trainer.data import vocabulary
from igrow.trainer.data.cells import Cells
from igrow.trainer.data.importing.odd_times import parts_of_time, spread
from igrow.trainer.data.importing.time_format import is_clock, looks_like_time
from igrow.trainer.data.mapping import MISSING
from igrow.trainer.data.named_days import how_to_date

_SAMPLE = 400
"""Rows that are looked at."""
_ACROSS, _LEAST_ACROSS = 0.8, 12
"""Share of a line's cells, and how many, that are times or hours where they stand across."""
_ABOVE = 12
"""Lines among which that of the times stands, where they stand across."""
_NUMERIC = re.compile(r"[-+\u2212]?\d[\d.,'\u00a0 ]*([eE][-+]?\d+)?\s*(-|%|°?[CF]|ppm|W/m²|W/m2|m/s|km/h|mph)?")
_WITHOUT_YEAR = re.compile(r"\d{1,2}[-/.]\d{1,2}\.?\s+\d{1,2}:\d{2}(:\d{2})?")


def is_value(cell: str) -> bool:
    """Tell whether a cell may be a reading: a number, nothing, or a word for on and off."""
    return _NUMERIC.fullmatch(cell) is not None or cell in MISSING or cell.lower() in vocabulary.switch_words()


def first_reading(cells: Cells, *, day_in_name: bool = False) -> int:
    """Return the index of the first row of readings: it has a time and a value, and so has the next.

    Where `day_in_name`, a time of day is one.

    Raises:
        IgrowError: there is none; it says what would be right.
    """
    usual = Counter(len(row) for row in cells.rows[-_SAMPLE:]).most_common(1)
    is_time = _is_hour if day_in_name else looks_like_time
    width = usual[0][0] if usual else 0
    readings = [_is_reading(row, width, is_time) for row in cells.rows[: _SAMPLE + 2]]
    hours = next((row for row in cells.rows[:_ABOVE] if _stand_across(row, _is_hour)), None)
    if hours is not None:
        first = ", ".join([cell for cell in hours if _is_hour(cell)][:3])
        raise IgrowError(f"{cells.path}: the hours of a day stand across ({first}, ...): export a row for each time")
    for index, found in enumerate(readings[:_SAMPLE]):
        # A line above the table may have the time of the export and a number.
        following = range(index + 1, min(index + 3, len(cells.rows)))
        if found and (not following or any(readings[row] or _is_of_the_day(cells.rows[row]) for row in following)):
            return index
    raise IgrowError(f"{cells.path}: {_why_none(cells.rows[:_SAMPLE], cells.sheet)}")


def times_stand_across(cells: Cells) -> bool:
    """Tell whether a table has a column for each time and a line for each sensor."""
    return any(_stand_across(row, looks_like_time) for row in cells.rows[:_ABOVE]) and not any(
        _is_reading(row, 0) for row in cells.rows[1:_ABOVE]
    )


def _stand_across(row: Sequence[str], kind: Callable[[str], bool]) -> bool:
    filled = [cell for cell in row if cell]
    return sum(map(kind, filled)) >= max(_ACROSS * len(filled), _LEAST_ACROSS)


def _is_hour(cell: str) -> bool:
    return is_clock(cell) and ":" in cell


def _is_of_the_day(row: Sequence[str]) -> bool:
    """Tell whether a row has a value and a time of day, its day on a row above."""
    return any(map(_is_hour, row)) and any(map(is_value, filter(None, row)))


def _is_reading(row: Sequence[str], usual: int, is_time: Callable[[str], bool] = looks_like_time) -> bool:
    """Tell whether a row has a time and a value."""
    filled = [cell for cell in row if cell]
    return len(row) >= 0.5 * usual and any(map(is_time, filled)) and any(map(is_value, filled))


def times_have_no_day(cells: Cells) -> bool:
    """Tell whether most rows have a time of day, and none of those a date; a number is taken for no date here."""
    rows = cells.rows[:_SAMPLE]
    timed = [row for row in rows if any(map(_is_hour, row))]
    return len(timed) > 0.5 * len(rows) and not any(
        looks_like_time(cell) and _NUMERIC.fullmatch(cell) is None for row in timed for cell in row if cell
    )


def _has_week(cell: str) -> bool:
    words = {vocabulary.folded(word) for word in re.findall(r"[^\W\d_]+", cell)}
    return any(word in words for word, _ in vocabulary.time_words("week")) and any(map(str.isdigit, cell))


def _why_none(rows: Sequence[Sequence[str]], sheet: str) -> str:
    """Return why no row of a table is a reading, and what would be right."""
    parts = next((found for row in rows if len(found := parts_of_time(row)) > 2), ())
    if parts:
        return spread(parts)
    for row in rows:
        first = [cell for cell in row if cell][:2]
        if len(row) > 1 and any(map(is_value, row)):
            clock = next(filter(_is_hour, first), None)
            if clock is not None:
                return f"its times, such as {clock!r}, have no date: {how_to_date(sheet)}"
            dated = next((cell for cell in first if _WITHOUT_YEAR.fullmatch(cell)), None)
            week = next(filter(_has_week, first), None)
            if week is not None:
                return f"its times, such as {week!r}, tell the week and no date: write them as 2020-02-01 13:30"
            if dated is not None:
                return f"its times, such as {dated!r}, have no year: write it in, such as 2020-02-01 13:30"
    return (
        "no row has a time and numbers: export the log as a table with a row for each time and a column for each sensor"
    )
