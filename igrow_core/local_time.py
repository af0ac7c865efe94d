"""Local wall time and UTC: people and price tariffs think in the first, everything else here in the second."""

from __future__ import annotations

import datetime
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError, available_timezones

import numpy as np

from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError

_QUARTER = 900
"""Seconds: offsets change on whole quarters of an hour of UTC in every zone since 1970."""


def zone(name: str) -> ZoneInfo:
    """Return the time zone of an IANA name such as Europe/Amsterdam; raises IgrowError where there is none."""
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        if not available_timezones():
            raise IgrowError(f"time zone {name!r}: this machine knows no time zone at all: install tzdata") from None
        raise IgrowError(f"time zone {name!r} is not known: a name such as Europe/Amsterdam is needed") from None


def utc_datetime(time: np.datetime64) -> datetime.datetime:
    """Return an instant in UTC as a `datetime` that knows its zone, to the second."""
    return datetime.datetime.fromisoformat(str(time.astype("datetime64[s]"))).replace(tzinfo=datetime.UTC)


def to_local(time: Times, time_zone: str) -> Times:
    """Return the wall time of UTC times, datetime64[s] of the same shape."""
    time = np.asarray(time, dtype="datetime64[s]")
    quarters, index = np.unique(time.astype(np.int64) // _QUARTER, return_inverse=True)
    where = zone(time_zone)
    offsets = [_offset(datetime.datetime.fromtimestamp(quarter * _QUARTER, where)) for quarter in quarters.tolist()]
    local: Times = time + np.array(offsets, dtype="timedelta64[s]")[index].reshape(time.shape)
    return local


def from_local(time: Times, time_zone: str) -> Times:
    """Return UTC times of wall times in the order they were written down, shape (n,); NaT where a time never was.

    When clocks go back one hour happens twice: a row belongs to the second pass from where the wall time jumps
    back on, else to the first. When clocks go forward the skipped wall times do not exist.
    """
    time = np.asarray(time, dtype="datetime64[s]")
    quarters, index = np.unique(time.astype(np.int64) // _QUARTER, return_inverse=True)
    where = zone(time_zone)
    naive = [
        datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=quarter * _QUARTER) for quarter in quarters.tolist()
    ]
    first = np.array([_offset(t.replace(tzinfo=where)) for t in naive], dtype="timedelta64[s]")[index]
    second = np.array([_offset(t.replace(tzinfo=where, fold=1)) for t in naive], dtype="timedelta64[s]")[index]
    doubled = second < first
    skipped = second > first
    again = np.zeros(len(time), dtype=bool)
    jumped = False
    for position in np.flatnonzero(doubled).tolist():
        if position == 0 or not doubled[position - 1]:
            jumped = False
        elif time[position] <= time[position - 1]:
            jumped = True
        again[position] = jumped
    result: Times = time - np.where(again, second, first)
    result[skipped] = np.datetime64("NaT")
    return result


def hour_of_day(time: Times, time_zone: str) -> Floats:
    """Return the local hour of UTC times, 0 to 24."""
    local = to_local(time, time_zone)
    seconds: Floats = (local - local.astype("datetime64[D]")).astype(np.float64)
    return seconds / 3600.0


def _offset(moment: datetime.datetime) -> int:
    offset = moment.utcoffset()
    assert offset is not None  # the moment has a zone
    return int(offset.total_seconds())
