"""Texts of a file as values, by the type that is wanted; and in words what a type takes.

| field type | reads |
|---|---|
| `float`, `int` | 1200, 1.2e3, -5; `int` also 0x1f; no quotes, no leading zero, no infinity |
| `bool` | true or false |
| `str` | the text as written, on and 12:30 too |
| an `Enum`, `Literal[...]` | one of its values |
| `datetime.time` | 12:30 or 12:30:15 |
| `datetime.date`, `datetime.datetime` | 2020-01-31; 2020-01-31T12:30:00Z |
| `datetime.timedelta` | a number and a unit: 30 s, 5 min, 1 h, 2 days, 1 week |
"""

from __future__ import annotations

import datetime
import difflib
import re
import types
from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Any, Literal, Union, get_args, get_origin

_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
_LEADING_ZERO = re.compile(r"[-+]?0\d")
_DURATION = re.compile(r"(\d+(?:\.\d+)?)\s*([a-z]+)")
_SECONDS = {
    **dict.fromkeys(("s", "second", "seconds"), 1.0),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
    **dict.fromkeys(("day", "days"), 86_400.0),
    **dict.fromkeys(("week", "weeks"), 604_800.0),
}


def nearest(name: str, known: Iterable[str]) -> str:
    """Return `did you mean X?` for a misspelt name, or the list of what is known."""
    choices = list(known)
    found = difflib.get_close_matches(name, choices, n=1)
    return f"did you mean {found[0]}?" if found else f"known here: {', '.join(choices)}"


def read_number(text: str) -> float:
    """Return a number written as in these files; for a key that is a number or a word. Raises ValueError."""
    number: float = convert(text, float)
    return number


def convert(text: str, kind: Any) -> Any:
    """Return the scalar `text` as `kind`; raises ValueError, with a hint where there is a better one than the type."""
    if kind is str:
        return text
    if kind is bool:
        if text not in ("true", "false"):
            raise ValueError("true or false is needed")
        return text == "true"
    if kind is int and re.fullmatch(r"0x[0-9a-fA-F]+", text):
        return int(text, 16)
    if kind in (int, float):
        if _LEADING_ZERO.match(text):
            raise ValueError("a number does not begin with 0; write it without")
        if not _NUMBER.fullmatch(text):
            raise ValueError
        number = float(text)
        if number in (float("inf"), float("-inf")):
            raise ValueError("the number is too large")
        if kind is int:
            if number != int(number):
                raise ValueError("a whole number is needed")
            return int(number) if "." in text or "e" in text.lower() else int(text)
        return number
    if get_origin(kind) is Literal:
        return _choice(text, {str(value): value for value in get_args(kind)})
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _choice(text, {str(member.value): member for member in kind})
    if kind is datetime.time:
        if not re.fullmatch(r"\d\d?:\d\d(:\d\d)?", text):
            raise ValueError
        hour, minute, second = (int(part) for part in (text + ":0").split(":")[:3])
        try:
            return datetime.time(hour, minute, second)
        except ValueError:
            raise ValueError("a time of day from 00:00 to 23:59 is needed") from None
    if kind is datetime.timedelta:
        match = _DURATION.fullmatch(text)
        if not match or match[2] not in _SECONDS:
            raise ValueError
        try:
            return datetime.timedelta(seconds=float(match[1]) * _SECONDS[match[2]])
        except OverflowError:
            raise ValueError("the duration is too long") from None
    if kind is datetime.date:
        if not re.fullmatch(r"\d{4}-\d\d-\d\d", text):
            raise ValueError
        try:
            return datetime.date.fromisoformat(text)
        except ValueError:
            raise ValueError("there is no such day") from None
    if kind is datetime.datetime:
        if not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d)?Z", text):
            raise ValueError
        return datetime.datetime.fromisoformat(text)
    raise TypeError(f"a schema cannot have a field of type {kind}")


def _choice(text: str, choices: Mapping[str, Any]) -> Any:
    if text not in choices:
        raise ValueError(nearest(text, choices))
    return choices[text]


def wanted(kind: Any, limits: Mapping[str, Any]) -> str:
    """Say in words what a field of this type and these limits takes."""
    arguments = [argument for argument in get_args(kind) if argument is not type(None)]
    if get_origin(kind) in (Union, types.UnionType) and len(arguments) == 1:
        return wanted(arguments[0], limits)
    words = {
        float: "a number",
        int: "a whole number",
        bool: "true or false",
        str: "a text",
        datetime.time: "a time of day such as 07:30",
        datetime.date: "a date such as 2020-01-31",
        datetime.datetime: "a time in UTC such as 2020-01-31T12:30:00Z",
        datetime.timedelta: "a duration such as 30 s, 5 min, 1 h or 2 days",
    }
    if kind in words:
        unit, low, high = limits.get("unit"), limits.get("low"), limits.get("high")
        text = words[kind] + (f" in {unit}" if unit and unit != "1" else "")
        if low is not None and high is not None:
            return f"{text} from {_plain(low)} to {_plain(high)}"
        if low is not None:
            return f"{text} of at least {_plain(low)}"
        return f"{text} of at most {_plain(high)}" if high is not None else text
    if get_origin(kind) is Literal:
        return f"one of {listed(str(value) for value in arguments)}"
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"one of {listed(str(member.value) for member in kind)}"
    return "a list" if get_origin(kind) is tuple else "its keys below it"


def duration(value: datetime.timedelta) -> str:
    """Return a duration as a file has it: `5 min`, `1 h`, `2 days`."""
    seconds = value.total_seconds()
    for size, name in ((86_400, "day"), (3600, "h"), (60, "min")):
        count = seconds / size
        if seconds >= size and count == int(count):
            return f"{count:.0f} {name}{'s' if name == 'day' and count > 1 else ''}"
    return f"{seconds!r} s" if seconds % 1 else f"{seconds:.0f} s"


def _plain(value: float | datetime.timedelta) -> str:
    return duration(value) if isinstance(value, datetime.timedelta) else f"{value:g}"


def listed(names: Iterable[str]) -> str:
    """Return names as people list them."""
    return ", ".join(names)
