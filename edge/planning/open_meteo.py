"""A weather forecast in the JSON of Open-Meteo, from a file: one course, or the members of an ensemble.

The forecast API names hourly columns (`temperature_2m`), the ensemble API adds `_member01` and so on to them; times
come as local ISO 8601 with `utc_offset_seconds`, or as seconds since 1970. Radiation is the mean of the hour before.
See https://open-meteo.com/en/docs and https://open-meteo.com/en/docs/ensemble-api. Nothing is fetched here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object
from igrow.core.telemetry import Telemetry, read_csv

COLUMNS = {
    "temperature_2m": "outdoor_temperature",
    "relative_humidity_2m": "outdoor_humidity",
    "shortwave_radiation": "global_radiation",
    "wind_speed_10m": "wind_speed",
    "wind_direction_10m": "wind_direction",
}
NEEDED = ("temperature_2m", "relative_humidity_2m", "shortwave_radiation", "wind_speed_10m")
SPEED = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 0.514444}
"""To m s-1."""
TEMPERATURE = {"°C": (1.0, 0.0), "°F": (1.0 / 1.8, -32.0 / 1.8)}
MOST_MEMBERS = 8
"""Members of an ensemble that are planned with: as many, evenly taken, as a gateway has time for."""
LATEST = 4e9
"""Seconds since 1970: beyond it there is no weather."""
_MEMBER = re.compile(r"_member(\d+)$")


def read_forecast(path: Path) -> tuple[Telemetry, ...]:
    """Return the forecast of a file: telemetry (CSV), or Open-Meteo's JSON with its members, at most `MOST_MEMBERS`.

    Raises IgrowError with the file and what is wrong in it.
    """
    if path.suffix.lower() != ".json":
        return (read_csv(path),)
    try:
        with path.open("rb") as file:
            content = parse_object(file.read(LARGEST_DOCUMENT + 1), str(path))
    except OSError as error:
        raise IgrowError(f"{path}: cannot be read: {error.strerror}") from None
    return _members(path, content)


def _members(path: Path, content: Mapping[str, Any]) -> tuple[Telemetry, ...]:
    hourly = content.get("hourly")
    if not isinstance(hourly, Mapping):
        reason = content.get("reason")
        told = f": it says {reason!r}" if reason else ""
        raise IgrowError(f"{path}: holds no `hourly` weather of Open-Meteo{told}")
    time = _times(path, hourly.get("time"), content.get("utc_offset_seconds", 0))
    units = content.get("hourly_units") or {}
    if not isinstance(units, Mapping):
        raise IgrowError(f"{path}: `hourly_units` holds no units by name")
    found = sorted({match.group() for name in hourly if (match := _MEMBER.search(name))})
    suffixes = [""] * any(name in hourly for name in NEEDED) + found
    if not suffixes:
        raise IgrowError(f"{path}: `hourly` lacks {', '.join(NEEDED)}")
    step = max(1.0, len(suffixes) / MOST_MEMBERS)
    chosen = [suffixes[int(place * step)] for place in range(min(len(suffixes), MOST_MEMBERS))]
    return tuple(_member(path, hourly, units, time, suffix) for suffix in chosen)


def _member(path: Path, hourly: Mapping[str, Any], units: Mapping[str, Any], time: Floats, suffix: str) -> Telemetry:
    columns: dict[str, Floats] = {}
    for theirs, ours in COLUMNS.items():
        given = hourly.get(theirs + suffix)
        if given is None:
            if theirs in NEEDED:
                raise IgrowError(f"{path}: `hourly` lacks {theirs}{suffix}")
            continue
        try:
            values = np.array([np.nan if one is None else float(one) for one in given])
        except (TypeError, ValueError):
            raise IgrowError(f"{path}: {theirs}{suffix} holds what is no number") from None
        if len(values) != len(time):
            raise IgrowError(f"{path}: {theirs}{suffix} has {len(values)} values for {len(time)} times")
        columns[ours] = _in_our_unit(path, theirs, values, str(units.get(theirs + suffix, units.get(theirs, ""))))
    # A row stands for the hour that it begins; their radiation for the hour that it ends.
    columns["global_radiation"] = np.append(columns["global_radiation"][1:], np.nan)
    return Telemetry(time.astype(np.int64).astype("datetime64[s]"), columns)


def _in_our_unit(path: Path, name: str, values: Floats, unit: str) -> Floats:
    if name == "wind_speed_10m":
        # Without a unit it is the default of Open-Meteo.
        if (unit or "km/h") not in SPEED:
            raise IgrowError(f"{path}: {name} is in {unit}: {', '.join(SPEED)} are known")
        return values * SPEED[unit or "km/h"]
    if name == "temperature_2m":
        if (unit or "°C") not in TEMPERATURE:
            raise IgrowError(f"{path}: {name} is in {unit}: {', '.join(TEMPERATURE)} are known")
        slope, offset = TEMPERATURE[unit or "°C"]
        return values * slope + offset
    return values


def _times(path: Path, given: Any, offset: Any) -> Floats:
    """Return seconds since 1970 UTC."""
    if not isinstance(given, list) or not given:
        raise IgrowError(f"{path}: `hourly` lacks time")
    try:
        if isinstance(given[0], str):
            local = np.array(given, dtype="datetime64[s]").astype(np.int64).astype(np.float64)
            seconds = local - float(offset)
        else:
            seconds = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise IgrowError(f"{path}: `hourly.time` holds what is no time") from None
    if not (np.abs(seconds) < LATEST).all():
        raise IgrowError(f"{path}: `hourly.time` holds what is no time")
    if (np.diff(seconds) <= 0.0).any():
        raise IgrowError(f"{path}: the times of `hourly` must follow one another")
    return seconds
