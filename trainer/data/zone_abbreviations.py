"""Abbreviations of time zones behind times, such as EST: which there are, and how far ahead of UTC each is.

An abbreviation is of a zone and of a season: CST is six hours behind UTC in Chicago and eight ahead in Shanghai. The
zone of the log decides; without one an abbreviation counts that is of one zone alone.
"""

from __future__ import annotations

import datetime
import re
from functools import cache

from igrow.core.local_time import zone
from igrow.trainer.data.vocabulary import zone_hours, zones_called

_LAST = re.compile(r"(?<=[\d.m])\s?[(\[]?([a-z]{2,5})[)\]]?$", re.IGNORECASE)


def split(text: str) -> tuple[str, str]:
    """Return a time without the abbreviation behind it, and that in capitals; empty where there is none."""
    found = _LAST.search(text)
    name = found[1].upper() if found is not None else ""
    if found is None or not (name in zone_hours() or zones_called(name)):
        return text, ""
    return text[: found.start()], name


@cache
def ahead_of_utc(name: str, time_zone: str, year: int) -> datetime.timedelta | None:
    """Return how far ahead of UTC an abbreviation is, or None where it is of several zones, none of them the log's.

    Args:
        name: in capitals.
        time_zone: of the log, an IANA name.
        year: in which the zone's own seasons are looked up.
    """
    where = zone(time_zone)
    for month in (1, 7):
        moment = datetime.datetime(year, month, 15, tzinfo=where)
        if moment.tzname() == name:
            return moment.utcoffset()
    hours = zone_hours().get(name)
    return None if hours is None else datetime.timedelta(hours=hours)
