"""In which zone the times of an export are, by its own words or the site's."""

from __future__ import annotations

import re

from igrow.core.site import Site
from igrow.trainer.data import vocabulary
from igrow.trainer.data.export import written_times
from igrow.trainer.data.export_table import ExportTable
from igrow.trainer.data.importing.time_format import TimeForm
from igrow.trainer.data.mapping import TimeColumn
from igrow.trainer.data.timestamps import UNIX, ZONE, wall_parser
from igrow.trainer.data.zone_abbreviations import ahead_of_utc, split

_OFFSET = re.compile(r"(?:GMT|UTC)\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?")
_WITH_OFFSET = re.compile(r"(\dT|:)\S*\s*(Z|[+-]\d\d:?\d\d)(\[[\w/+-]+\])?$")
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
    if time.form.endswith(ZONE):
        return _abbreviated(time, table, site)
    told = _zone_in(" ".join((time.column, time.time_of_day or "")))
    if told is not None:
        return told, f"the column's name says that times are {told}"
    sample = next((text for text in table[time.column] if text), "")
    if time.form in UNIX or _WITH_OFFSET.search(sample.strip()):
        return "UTC", ""
    if site is not None and site.time_zone != "UTC":
        return site.time_zone, f"times are taken for wall times of {site.time_zone}, the site's zone"
    return None, ""


def _abbreviated(time: TimeForm, table: ExportTable, site: Site | None) -> tuple[str | None, str]:
    """Return the zone by which the abbreviations behind times are read; None where they are of several zones."""
    texts = written_times(table, TimeColumn(time.column, time.time_of_day, time.form))
    found = {name: split(text)[0] for text in texts if (name := split(text)[1])}
    year = min((wall_parser(time.form)(f"{text} UTC").year for text in found.values()), default=2000)
    zones = dict.fromkeys((site.time_zone if site is not None else "UTC", "UTC"))
    for zone in zones:
        if all(ahead_of_utc(name, zone, year) is not None for name in found):
            return zone, f"each time tells its zone: {', '.join(sorted(found))}"
    return None, ""


def zones_asked(time: TimeForm, table: ExportTable) -> tuple[str, ...]:
    """Return the zones that the abbreviations behind times may mean, where they are of several."""
    texts = written_times(table, TimeColumn(time.column, time.time_of_day, time.form))
    names = dict.fromkeys(split(text)[1] for text in texts)
    return tuple(dict.fromkeys(zone for name in names for zone in vocabulary.zones_called(name)))


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
