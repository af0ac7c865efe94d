"""What has stood in the greenhouse so far, as far as the limits count it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from igrow.core.agronomy.moment import Moment, Place, moment
from igrow.core.arrays import Array, Floats
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry, to_grid

SWITCHED = ("lamp_on", "irrigation_on")
_BY_NAME = ("level", "since")
LOOKS_BACK = 172_800.0
"""Seconds of a log that limits may still count."""
STEP = 300
"""Seconds by which a log is read."""
LONG_AGO = 1e6
"""Hours since the last switching where none is known."""


@dataclass(frozen=True)
class Memory:
    """What limits count; floats, or arrays over candidates. Without a history nothing is known to have been given."""

    night: int = -1
    """The night that the next two belong to."""
    dark: Array = 0.0
    """Hours without lamps and sun until now, in one stretch."""
    darkest: Array = 0.0
    """The longest such stretch of that night, h."""
    day: int = -1
    """The local day that the next five belong to."""
    heat_sum: Array = 0.0
    """Of the heating setpoint, K h."""
    heat_hours: float = 0.0
    """Hours that `heat_sum` covers."""
    lowest: Array = np.inf
    """Heating setpoint of that day, degC."""
    highest: Array = -np.inf
    light: Array = 0.0
    """Of sun and lamps, mol m-2."""
    heating: Array = np.nan
    """Heating setpoint that stands now, degC; NaN where it is not known."""
    level: Mapping[str, Array] = field(default_factory=dict)
    """Level that stands now, by name of `SWITCHED`."""
    since: Mapping[str, Array] = field(default_factory=dict)
    """Hours since it was last switched on or off."""


def at(memory: Memory, now: Moment) -> Memory:
    """Return the memory as it counts at `now`: of another night or day nothing is left."""
    if memory.night != now.night:
        memory = replace(memory, night=now.night, dark=0.0, darkest=0.0)
    if memory.day != now.day:
        standing = memory.heating
        memory = replace(
            memory,
            day=now.day,
            heat_sum=0.0,
            heat_hours=0.0,
            light=0.0,
            lowest=np.where(np.isnan(standing), np.inf, standing),
            highest=np.where(np.isnan(standing), -np.inf, standing),
        )
    return memory


def observe(
    memory: Memory, place: Place, now: Moment, standing: Mapping[str, Array], hours: float, sunlight: float = 0.0
) -> Memory:
    """Return the memory after `standing` setpoints have stood for `hours` from `now` on.

    Args:
        memory: until `now`.
        place: whose lamps they are.
        now: when they began to stand.
        standing: setpoints by name; one that is not known is left out.
        hours: for which they stood.
        sunlight: of these hours, mol m-2 h-1 above the crop.
    """
    if hours > now.hours_left + 1e-6:
        # What stands over midnight counts for both days.
        before = observe(memory, place, now, standing, now.hours_left, sunlight)
        midnight = moment(place, now.seconds + 3600.0 * now.hours_left)
        return observe(before, place, midnight, standing, hours - now.hours_left, sunlight)
    memory = at(memory, now)
    lamp = standing.get("lamp_on", 0.0)
    end = now.seconds + 3600.0 * hours
    under = (max(0.0, min(end, now.night_ends) - max(now.seconds, now.night_begins))) / 3600.0
    dark = np.where(np.asarray(lamp) > 0.0, 0.0, memory.dark + under)
    level, since = dict(memory.level), dict(memory.since)
    for name in SWITCHED:
        if name in standing:
            stood = level.get(name)
            same = stood is None or (np.asarray(stood) > 0.0) == (np.asarray(standing[name]) > 0.0)
            since[name] = np.where(same, since.get(name, LONG_AGO), 0.0) + hours
            level[name] = standing[name]
    changes: dict[str, Any] = {}
    if "heating_setpoint" in standing:
        heating = standing["heating_setpoint"]
        changes = {
            "heating": heating,
            "heat_sum": memory.heat_sum + heating * hours,
            "heat_hours": memory.heat_hours + hours,
            "lowest": np.minimum(memory.lowest, heating),
            "highest": np.maximum(memory.highest, heating),
        }
    return replace(
        memory,
        dark=dark,
        darkest=np.maximum(memory.darkest, dark),
        light=memory.light + (sunlight + place.lamp_light * lamp) * hours,
        level=level,
        since=since,
        **changes,
    )


def one_of(memory: Memory, candidate: int) -> Memory:
    """Return the memory of one of several candidates."""

    def one(value: Any) -> Any:
        array = np.asarray(value)
        return value if array.ndim == 0 else array[candidate]

    changes: dict[str, Any] = {}
    for part in fields(Memory):
        value = getattr(memory, part.name)
        changes[part.name] = {key: one(each) for key, each in value.items()} if part.name in _BY_NAME else one(value)
    return replace(memory, **changes)


def remember(place: Place, log: Telemetry, until: float) -> Memory:
    """Return what a log of setpoints up to `until` (seconds since 1970 UTC) leaves to be counted.

    Where the log is silent lamps may have burned, and nothing counts as given. An empty log leaves nothing.
    """
    begin = np.datetime64(int(until - LOOKS_BACK), "s")
    log = log.select(begin, np.datetime64(int(until), "s"))
    if not len(log):
        return Memory()
    log = to_grid(log, STEP)
    seconds = unix_seconds(log.time)
    memory = Memory()
    stood = {name: _standing(log[name]) for name in ("heating_setpoint", *SWITCHED) if name in log}
    radiation = log.columns.get("global_radiation", np.zeros(len(log)))
    for row, begins in enumerate(seconds.tolist()):
        standing = {name: float(values[row]) for name, values in stood.items() if np.isfinite(values[row])}
        if "lamp_on" not in standing and place.lamp_light > 0.0:
            standing["lamp_on"] = 1.0
        sun = float(radiation[row]) if np.isfinite(radiation[row]) else 0.0
        hours = (min(begins + STEP, until) - begins) / 3600.0
        memory = observe(memory, place, moment(place, begins), standing, hours, place.sunlight(sun))
    return memory


def _standing(values: Floats) -> Floats:
    """Return values on a grid of `STEP` with each standing until the next, for an hour at most."""
    rows = np.arange(len(values))
    last = np.maximum.accumulate(np.where(np.isfinite(values), rows, -1))
    stands = (last >= 0) & (rows - last < 3600 // STEP)
    return np.where(stands, values[np.maximum(last, 0)], np.nan)
