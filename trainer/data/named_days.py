"""Tables whose rows have times of day alone: their day stands in the name of the sheet, or of the file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.data.day_halves import with_english_halves
from igrow.trainer.data.timestamps import with_english_months
from igrow.trainer.data.vocabulary import folded, month_names

COLUMN = "(day in the name)"
"""The column that such a table gets."""
_YEAR = r"(?:19|20)\d\d"
_YEAR_FIRST = rf"(?<!\d)({_YEAR})([-_. ]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])(?=\D|$|\d{{4}}(?:\d\d)?(?!\d))"
_YEAR_LAST = rf"(?<!\d)(\d{{1,2}})([-_. ])(\d{{1,2}})\2({_YEAR}|\d\d)(?!\d)"
_COMPACT = rf"(?<!\d)([0-3]\d)([0-3]\d)({_YEAR})(?!\d)"
_MONTH_NAMED = rf"(?<!\d)(\d{{1,2}})[-_. ]+(?:de )?([^\W\d_]{{3,}})\.?[-_., ]+(?:de )?({_YEAR})(?!\d)"
_MONTH_FIRST = rf"([^\W\d_]{{3,}})\.?[-_ ]+(\d{{1,2}}),?[-_ ]+({_YEAR})(?!\d)"
_CLOCK = re.compile(r"(\d{1,2})[:.h](\d{2})(?:[:.]\d+)*\s*([ap])?m?\b.*", re.IGNORECASE)
_LATE = 12 * 60
"""Minutes by which a time of day goes back where a day has ended; where clocks change it is an hour."""
_MOST = 0.9
"""Share of a column's texts that are times of day, if it is theirs."""
_MEND = "put the date in a column of its own"


def day_in(name: str) -> str | None:
    """Return the one date in the name of a file or a sheet, its parts joined anew; None: it has none, or several."""
    found = dict.fromkeys(_dates(name))
    return next(iter(found)) if len(found) == 1 else None


def _dates(name: str) -> Iterator[str]:
    for pattern in (_YEAR_FIRST, _MONTH_NAMED, _MONTH_FIRST, _YEAR_LAST, _COMPACT):
        for match in re.finditer(pattern, name):
            parts = [part for part in match.groups() if part.isalnum()]
            if pattern not in (_MONTH_NAMED, _MONTH_FIRST):
                yield "-".join(parts)
            elif any(folded(part) in month_names() for part in parts):
                yield with_english_months(" ".join(parts))
        name = re.sub(pattern, "|", name)


def with_day(
    path: Path, sheet: str, columns: Mapping[str, Sequence[str]], lines: Sequence[int]
) -> Mapping[str, Sequence[str]]:
    """Return columns, and one more with the day that their sheet or their file is named after.

    The midnight that ends the day becomes its hour 24.

    Args:
        path: of the file.
        sheet: its name in a workbook, else empty.
        columns: name -> texts, (n,).
        lines: of the rows, (n,).

    Raises:
        IgrowError: neither name tells one day, or the rows go on into another.
    """
    day = day_in(sheet) or day_in(path.name)
    if day is None:
        raise IgrowError(f"{path}: its times have no date: {how_to_date(sheet)}")
    name = next((name for name, texts in columns.items() if _are_clocks(texts)), None)
    clocks = list(columns[name]) if name is not None else []
    minutes = [_minutes(text) for text in clocks]
    known = [row for row, at in enumerate(minutes) if at is not None]
    late = [row for row, at in zip(known[1:], known, strict=False) if (minutes[row] or 0) < (minutes[at] or 0) - _LATE]
    if name is not None and late == known[-1:] and re.match(r"0?0\D", clocks[late[0]]):
        clocks[late[0]] = re.sub(r"^0?0", "24", clocks[late[0]])
        columns = {**columns, name: clocks}
    elif late:
        raise IgrowError(f"{path}:{lines[late[0]]}: another day begins, and the name tells {day} alone: {_MEND}")
    return {**columns, COLUMN: [day] * len(lines)}


def how_to_date(sheet: str = "") -> str:
    """Return what would be right where times have no date."""
    named = f"name its sheet {sheet!r}" if sheet else "name the file"
    return f"{_MEND}, or {named} after its day, such as 2020-02-01"


def _are_clocks(texts: Sequence[str]) -> bool:
    filled = [text for text in texts if text]
    return bool(filled) and sum(":" in text and _minutes(text) is not None for text in filled) >= _MOST * len(filled)


def _minutes(text: str) -> int | None:
    """Return the minutes since midnight of a time of day."""
    found = _CLOCK.fullmatch(with_english_halves(text))
    if found is None:
        return None
    half = (found[3] or "").lower()
    hour = int(found[1]) % 12 + 12 * (half == "p") if half else int(found[1])
    return 60 * hour + int(found[2])
