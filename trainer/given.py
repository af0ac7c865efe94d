"""What a caller gave, and what his machine has: where it is not right, one line says what would be."""

from __future__ import annotations

import datetime
from importlib import import_module
from typing import Any

import numpy as np

from igrow.core.errors import IgrowError

Moment = np.datetime64 | datetime.date | str
"""A time in UTC, or with a zone of its own; a date is its midnight."""
READ = "read_log(path, site) makes one"
MADE = "calibrate(log) or read_model(folder, site) makes one"


def installed(package: str, extra: str, needed: str) -> Any:
    """Return a package that not everybody has; raises IgrowError that names the extra of igrow that brings it."""
    try:
        return import_module(package)
    except ImportError:
        raise IgrowError(f"{needed} needs the package {package}: install igrow[{extra}]") from None


def must_be(kind: type, value: object, right: str) -> None:
    """Raise IgrowError where a value is not of a kind; `right` is what makes one."""
    if not isinstance(value, kind):
        raise IgrowError(f"a {kind.__name__} is needed, not a {type(value).__name__}: {right}")


def moment(value: Moment | None) -> np.datetime64 | None:
    """Return a time as it is in telemetry, None for none; raises IgrowError where it is no time."""
    if isinstance(value, str):
        try:
            value = datetime.datetime.fromisoformat(value)
        except ValueError:
            raise IgrowError(f"{value!r} is no time: 2020-02-01 or 2020-02-01T13:30, in UTC, is right") from None
    if isinstance(value, datetime.datetime) and value.tzinfo is not None:
        value = value.astimezone(datetime.UTC).replace(tzinfo=None)
    if value is None:
        return None
    if isinstance(value, np.datetime64):
        seconds: np.datetime64 = value.astype("datetime64[s]")
        return seconds
    if isinstance(value, datetime.date):
        return np.datetime64(value.isoformat(), "s")
    raise IgrowError(f"{value!r} is no time: a numpy.datetime64, a datetime or a text such as '2020-02-01' is right")
