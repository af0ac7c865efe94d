"""Write a schema's dataclass as the YAML that `yaml_schema` reads back, with what each key means beside it."""

from __future__ import annotations

import dataclasses
import datetime
import re
from collections.abc import Mapping
from enum import Enum
from typing import Any

from igrow.core.yaml_scalars import duration

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_./+-]*( [A-Za-z0-9_./+-]+)*")
_COMMENT_COLUMN = 44


def dump(instance: Any) -> str:
    """Return the YAML text of a dataclass made of `setting` fields, with unit, bounds and meaning of each."""
    return "\n".join([*_lines(instance, 0), ""])


def _lines(instance: Any, depth: int) -> list[str]:
    lines: list[str] = []

    def add(line: str, comment: str) -> None:
        if comment and len(line) >= _COMMENT_COLUMN:
            lines.append(f"{'  ' * depth}# {comment}")
        lines.append(f"{line:<{_COMMENT_COLUMN}}# {comment}" if comment and len(line) < _COMMENT_COLUMN else line)

    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        start = f"{'  ' * depth}{field.name}:"
        comment = _comment(field.metadata)
        if dataclasses.is_dataclass(value):
            add(start, comment)
            lines += _lines(value, depth + 1)
        elif isinstance(value, Mapping) and value:
            add(start, comment)
            lines += [f"{'  ' * (depth + 1)}{_text(key)}: {_flow(item)}" for key, item in value.items()]
        elif isinstance(value, tuple) and any(dataclasses.is_dataclass(item) for item in value):
            add(start, comment)
            lines += [f"{'  ' * (depth + 1)}- {_flow(item)}" for item in value]
        else:
            add(f"{start} {_flow(value)}", comment)
    return lines


def _comment(metadata: Mapping[str, Any]) -> str:
    unit, low, high = metadata.get("unit", ""), metadata.get("low"), metadata.get("high")
    bounds = ""
    if low is not None and high is not None:
        bounds = f"{_flow(low)} to {_flow(high)}"
    elif low is not None:
        bounds = f"at least {_flow(low)}"
    elif high is not None:
        bounds = f"at most {_flow(high)}"
    words = [unit if unit != "1" else "", bounds]
    inside = ", ".join(word for word in words if word)
    return f"{metadata.get('help', '')}{f' ({inside})' if inside else ''}"


def _flow(value: Any) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
    if isinstance(value, Enum):
        return _text(str(value.value))
    if isinstance(value, datetime.datetime):
        return value.astimezone(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    if isinstance(value, datetime.date):
        return value.isoformat()
    if isinstance(value, datetime.time):
        return value.isoformat("minutes" if value.second == 0 else "seconds")
    if isinstance(value, datetime.timedelta):
        return duration(value)
    if isinstance(value, tuple):
        return f"[{', '.join(_flow(item) for item in value)}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_text(key)}: {_flow(item)}" for key, item in value.items()) + "}"
    if dataclasses.is_dataclass(value):
        pairs = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return "{" + ", ".join(f"{name}: {_flow(item)}" for name, item in pairs) + "}"
    return _text(str(value))


def _text(text: str) -> str:
    if _PLAIN.fullmatch(text) and text != "null":
        return text
    return '"' + "".join(_escaped(sign) for sign in text) + '"'


def _escaped(sign: str) -> str:
    if sign in '"\\':
        return "\\" + sign
    return sign if " " <= sign <= "~" else f"\\U{ord(sign):08x}"
