"""Times as they are written, to UTC: ISO 8601 in all its forms, Excel's days, seconds since 1970, and strptime formats.

Names of months are read in the languages of `vocabulary.yaml`, whatever the language of the machine.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence

import numpy as np

from igrow.core.local_time import from_local
from igrow.core.telemetry import Times
from igrow.trainer.data.vocabulary import folded, month_names

ISO, EXCEL, UNIX, UNIX_MS = "ISO 8601", "excel", "unix", "unix ms"
_EXCEL_EPOCH = datetime.datetime(1899, 12, 30)
_UNIX_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_LETTERS = re.compile(r"[^\W\d_]+", re.UNICODE)


def parser(form: str) -> Callable[[str], datetime.datetime]:
    """Return the function that reads one text of a form; it raises ValueError where the text is of another one."""
    if form == ISO:
        return _iso
    if form == EXCEL:
        return lambda text: _EXCEL_EPOCH + datetime.timedelta(seconds=round(_number(text) * 86_400))
    if form in (UNIX, UNIX_MS):
        unit = 1.0 if form == UNIX else 1e-3
        return lambda text: _UNIX_EPOCH + datetime.timedelta(seconds=round(_number(text) * unit))
    return lambda text: _formatted(text, form)


def to_utc(texts: Sequence[str], form: str, time_zone: str) -> tuple[Times, int | None]:
    """Return UTC times of texts, in their order, and the position of the first that cannot be read (None: none).

    Args:
        texts: as written.
        form: `ISO 8601`, `excel`, `unix`, `unix ms`, or as strptime has it.
        time_zone: IANA name, of times that do not tell their own.

    A wall time that the change of clocks skipped becomes NaT.
    """
    read = parser(form)
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


def _of_wall(local: Times, time_zone: str) -> Times:
    """Return UTC times of wall times in the order of a file: forwards or backwards, each time on one row or several.

    In the hour that happens twice the order alone tells which is which.
    """
    if len(local) > 1 and (np.diff(local.astype(np.int64)) < 0).mean() > 0.5:
        backwards: Times = _of_wall(local[::-1], time_zone)[::-1]
        return backwards
    new = np.ones(len(local), dtype=bool)
    new[1:] = local[1:] != local[:-1]
    times: Times = from_local(local[new], time_zone)[np.cumsum(new) - 1]
    return times


def _iso(text: str) -> datetime.datetime:
    try:
        return datetime.datetime.fromisoformat(text)
    except ValueError:
        # What pandas writes of other zones, and a space before the offset.
        changed = re.sub(r"\s+(?=[+-]\d\d:?\d\d$|Z$)", "", text)
        changed, late = _after_midnight(changed)
        return datetime.datetime.fromisoformat(changed) + late


def _formatted(text: str, form: str) -> datetime.datetime:
    if "%b" in form:
        text = _LETTERS.sub(lambda found: month_names().get(folded(found[0]), found[0]), text)
    if "%p" in form:
        text = re.sub(r"\b([ap])\.\s?m\.?", r"\1m", text, flags=re.IGNORECASE)
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
    return float(text.replace(",", "."))
