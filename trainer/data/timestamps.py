"""Times as they are written, to UTC: ISO 8601 in all its forms, Excel's days, seconds since 1970, and strptime formats.

Names of months and of days of the week are read in the languages of `vocabulary.yaml`, whatever the language of the
machine; ``%Z`` at the end of a format is an abbreviation of a zone, such as EST.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence

import numpy as np

from igrow.core.arrays import Times
from igrow.core.local_time import from_local
from igrow.trainer.data.day_halves import with_english_halves
from igrow.trainer.data.vocabulary import folded, month_names, weekday_names
from igrow.trainer.data.zone_abbreviations import ahead_of_utc, split

ISO, EXCEL = "ISO 8601", "excel"
UNIX = {"unix": 1.0, "unix ms": 1e-3, "unix us": 1e-6, "unix ns": 1e-9}
"""Counts since 1970 -> their unit in seconds."""
_EXCEL_EPOCH = datetime.datetime(1899, 12, 30)
_UNIX_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
ZONE = "%Z"
_WEEKDAY = re.compile(r"([^\W\d_]{2,})\.?,?\s+(?=\w)")
_DATE = re.compile(r"\d{1,4}[-/.]\s?\d{1,2}[-/.]")
_ONE_ROW = 0.9
"""Share of rows with a time of their own from which on a log has one row for each time."""
_LETTERS = re.compile(r"[^\W\d_]+", re.UNICODE)
_MIDNIGHT = re.compile(r"(?<![\d:])(0?0:00|12:00(:00)?\s*a)", re.IGNORECASE)
_CLOCKED = re.compile(r"(.*?\d)[\sT,]+\d{1,2}:\d\d")
_MONTH = re.compile(r"([^\W\d_]+)(\.?)")
_OF = re.compile(r"(?<=\s)del?\s+", re.IGNORECASE)


def parser(form: str, time_zone: str = "UTC") -> Callable[[str], datetime.datetime]:
    """Return the function that reads one text of a form; it raises ValueError where the text is of another one.

    Args:
        form: `ISO 8601`, `excel`, one of `UNIX`, or as strptime has it; ``%Z`` at the end is an abbreviation.
        time_zone: IANA name; what an abbreviation of several zones stands for.
    """
    if form == ISO:
        return lambda text: _iso(without_weekday(text))
    if form.endswith(ZONE):
        plain = parser(form.removesuffix(ZONE).rstrip(), time_zone)
        return lambda text: _abbreviated(text, plain, time_zone)
    if form == EXCEL:
        return lambda text: _EXCEL_EPOCH + datetime.timedelta(seconds=round(_number(text) * 86_400))
    if form in UNIX:
        return lambda text: _UNIX_EPOCH + datetime.timedelta(seconds=round(_number(text) * UNIX[form]))
    return lambda text: _formatted(without_weekday(text), form)


def wall_parser(form: str) -> Callable[[str], datetime.datetime]:
    """Return `parser` of a form for wall times: whatever zone an abbreviation stands for."""
    if not form.endswith(ZONE):
        return parser(form)
    plain = parser(form.removesuffix(ZONE).rstrip())
    return lambda text: plain(split(text)[0])


def without_weekday(text: str) -> str:
    """Return a time without the day of the week before it; "mar" is a day in Madrid only where a date follows it."""
    found = _WEEKDAY.match(text)
    if found is None or (name := folded(found[1])) not in weekday_names():
        return text
    rest = text[found.end() :]
    dated = _DATE.match(rest) or any(folded(word) in month_names() for word in _LETTERS.findall(rest))
    return rest if dated or name not in month_names() else text


def with_english_months(text: str) -> str:
    """Return a date whose month has its English abbreviation: ``1 de febrero de 2020`` and ``1 févr. 2020`` alike."""

    def english(found: re.Match[str]) -> str:
        name = month_names().get(folded(found[1]))
        return found[0] if name is None else name

    changed = _MONTH.sub(english, text)
    return changed if changed == text else _OF.sub("", changed)


def _abbreviated(text: str, plain: Callable[[str], datetime.datetime], time_zone: str) -> datetime.datetime:
    written, name = split(text)
    moment = plain(written)
    ahead = ahead_of_utc(name, time_zone, moment.year) if name else None
    if ahead is None:
        raise ValueError(f"{name or 'nothing'} is no time zone")
    return moment.replace(tzinfo=datetime.timezone(ahead))


def to_utc(texts: Sequence[str], form: str, time_zone: str) -> tuple[Times, int | None]:
    """Return UTC times of texts, in their order, and the position of the first that cannot be read (None: none).

    Args:
        texts: as written.
        form: as `parser` has it.
        time_zone: IANA name, of times that do not tell their own, and of abbreviations that several zones have.

    A wall time that the change of clocks skipped becomes NaT.
    """
    read = parser(form, time_zone)
    local = np.empty(len(texts), dtype="datetime64[s]")
    shifts = np.zeros(len(texts), dtype="timedelta64[s]")
    aware = False
    for position, text in enumerate(texts):
        try:
            moment = read(text)
        except (ValueError, OverflowError):
            return local, position
        offset = moment.utcoffset()
        if offset is not None:
            aware = True
            shifts[position] = np.timedelta64(int(offset.total_seconds()), "s")
            moment = moment.replace(tzinfo=None)
        local[position] = np.datetime64(moment, "s")
    return (local - shifts if aware else _of_wall(local, time_zone)), None


def dates_alone(texts: Sequence[str]) -> set[int]:
    """Return the positions of dates without a time of day, where others have one and midnight is written out.

    They head a day, or stand before its mean or its sum.
    """
    texts = [with_english_halves(text) for text in texts]
    clocked = [found[1] for text in texts if (found := _CLOCKED.match(text)) is not None]
    if len(clocked) < 0.5 * len(texts) or not any(map(_MIDNIGHT.search, texts)):
        return set()
    days = set(clocked)
    return {row for row, text in enumerate(texts) if text in days}


def _of_wall(local: Times, time_zone: str) -> Times:
    """Return UTC times of wall times in the order of a file: forwards or backwards, each time on one row or several.

    In the hour that happens twice the order alone tells which is which.
    """
    if len(local) > 1 and (np.diff(local.astype(np.int64)) < 0).mean() > 0.5:
        return np.asarray(_of_wall(local[::-1], time_zone)[::-1])
    new = np.ones(len(local), dtype=bool)
    new[1:] = local[1:] != local[:-1]
    if np.count_nonzero(new) > _ONE_ROW * len(new):
        # Of an hourly log the hour that happens twice is the one time that stands on two rows.
        return from_local(local, time_zone)
    return np.asarray(from_local(local[new], time_zone)[np.cumsum(new) - 1])


def _iso(text: str) -> datetime.datetime:
    try:
        return datetime.datetime.fromisoformat(text)
    except ValueError:
        # What pandas writes of other zones, a space before the offset, and Java's name of the zone behind it.
        changed = re.sub(r"\s+(?=[+-]\d\d:?\d\d$|Z$)", "", re.sub(r"(?<=[\dZ])\[[\w/+-]+\]$", "", text))
        changed, late = _after_midnight(changed)
        return datetime.datetime.fromisoformat(changed) + late


def _formatted(text: str, form: str) -> datetime.datetime:
    if "%b" in form:
        text = with_english_months(text)
        form = re.sub(r"%b\.", "%b", form)
    if "%p" in form:
        text = with_english_halves(text)
    try:
        return datetime.datetime.strptime(text, form)
    except ValueError:
        changed, late = _after_midnight(text)
        if not late:
            raise
        return datetime.datetime.strptime(changed, form) + late


def _after_midnight(text: str) -> tuple[str, datetime.timedelta]:
    """Return a text with the hour 24 as 0, and the day that this adds."""
    changed = re.sub(r"(?<=[\sT])24(?=[:.]?00|$)", "00", text)
    return changed, datetime.timedelta(days=int(changed != text))


def _number(text: str) -> float:
    """Return a number, or the sum of a day and of its part that stand beside each other."""
    return sum(map(float, text.replace(",", ".").split(" ")))
