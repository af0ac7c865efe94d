"""What is odd about the times of a table, and what would be right."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from igrow.trainer.data import vocabulary
from igrow.trainer.data.day_halves import is_half
from igrow.trainer.data.importing.time_format import TimeForm, has_clock, is_clock, looks_like_time

_PARTS = ("year", "month", "day", "day_of_year", "week", "hour", "minute")


def what_is_odd(columns: Mapping[str, Sequence[str]], time: TimeForm | None) -> str | None:
    """Return why a table's time cannot be read, in a line; None where it can.

    Args:
        columns: texts by name.
        time: what was found of it.
    """
    if time is None:
        return _why_none(columns)
    found = [one for one in (time.column, time.time_of_day) if one is not None]
    parts = [one for one in parts_of_time(columns) if one not in found]
    if time.form.endswith("%H") and parts:
        return spread([*found, *parts])
    half = next((name for name, texts in columns.items() if _all_halves(texts)), None)
    if half is not None and "%p" not in time.form:
        return spread([*found, half])
    if time.time_of_day is None and not any(map(has_clock, columns[time.column])):
        for name, texts in columns.items():
            clocks = [text for text in texts if text]
            strange = next((text for text in clocks if not (is_clock(text) or looks_like_time(text))), "")
            if strange and all(map(has_clock, clocks)):
                return f"{name!r} has times of day with a word that is not known, such as {strange!r}: write 13:30"
    return None


def parts_of_time(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of columns that hold the year, the month, the day, the hour or the minute alone."""
    parts = [word for kind in _PARTS for word, _ in vocabulary.time_words(kind)]
    return tuple(name for name in names if vocabulary.folded(name) in parts)


def spread(parts: Sequence[str]) -> str:
    """Return what is said of a time that stands in so many columns."""
    return f"its time stands in {len(parts)} columns ({', '.join(parts)}): join them in one, such as 2020-02-01 13:30"


def _all_halves(texts: Sequence[str]) -> bool:
    told = set(filter(None, texts))
    return bool(told) and all(map(is_half, told))


def _why_none(columns: Mapping[str, Sequence[str]]) -> str:
    for name, texts in columns.items():
        first, *rest = [text for text in texts if text] or [""]
        strange = next((text for text in rest if not looks_like_time(text)), None)
        if first and looks_like_time(first) and strange is not None:
            return f"no column is a time: {name!r} begins with {first!r}, but has {strange!r} too"
    return f"no column is a time; it has {', '.join(columns)}"
