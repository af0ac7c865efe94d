"""In which zone the times of an export are, by its own words or the site's."""

from __future__ import annotations

import re

from igrow.core.site import Site
from igrow.trainer.data.export import ExportTable
from igrow.trainer.data.importing.time_format import TimeForm

_OFFSET = re.compile(r"(?:GMT|UTC)\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?")
_WITH_OFFSET = re.compile(r"(\dT|:)\S*\s*(Z|[+-]\d\d:?\d\d)$")
"""A time of day with its offset: the year of 18-10-2020 is none."""
_NAMED = re.compile(r"\b(UTC|GMT|CET|CEST)\b")


def find_zone(time: TimeForm, table: ExportTable, site: Site | None, given: str | None) -> tuple[str | None, str]:
    """Return the time zone of an export's times and why it is taken for that, or None where nobody tells it.

    Args:
        time: how its times are written.
        table: the export.
        site: the greenhouse, where it is known.
        given: by the user.
    """
    if given is not None:
        return given, ""
    told = _zone_in(" ".join((time.column, time.time_of_day or "")))
    if told is not None:
        return told, f"the column's name says that times are {told}"
    sample = next((text for text in table[time.column] if text), "")
    if time.form.startswith("unix") or _WITH_OFFSET.search(sample.strip()):
        return "UTC", ""
    if site is not None and site.time_zone != "UTC":
        return site.time_zone, f"times are taken for wall times of {site.time_zone}, the site's zone"
    return None, ""


def _zone_in(text: str) -> str | None:
    """Return the zone that a column's name tells: fixed offsets have the names of the time zone database."""
    offset = _OFFSET.search(text)
    if offset is not None and int(offset[3] or 0) == 0:
        hours = int(offset[2])
        return fixed(hours if offset[1] == "+" else -hours)
    named = _NAMED.search(text)
    return None if named is None else {"CET": fixed(1), "CEST": fixed(2)}.get(named[1], "UTC")


def fixed(hours: int) -> str:
    """Return the name of the zone that is always so many hours ahead of UTC."""
    # The database counts hours west of Greenwich.
    return "UTC" if hours == 0 else f"Etc/GMT{-hours:+d}"
