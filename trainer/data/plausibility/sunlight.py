"""Radiation against the sun over the site: the clock, the unit, and sums that were taken for rates.

The sun keeps the best clock of all. The mean solar hour of the radiation, weighted by the radiation, is noon to within
a quarter of an hour over a fortnight, whatever the weather; halfway between first and last light it is noon on every
single day, under clouds too, but for hills and chimneys, which are the same the day after; and what reaches the ground
is 0.5 to 0.8 of what would without air, whenever the sky is clear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from igrow.core import sun
from igrow.core.arrays import Floats, Integers, Times
from igrow.core.local_time import from_local, to_local
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault, Remedy
from igrow.trainer.data.grid import own_step
from igrow.trainer.data.plausibility.hemisphere import other_hemisphere
from igrow.trainer.data.plausibility.sums import running_sum

CLOCK = ("clock", "local_time", "no_daylight")
"""Faults that another time zone may mend."""
SUN = (*CLOCK, "latitude")
"""Faults after which nothing can be said of day and night."""
LARGEST_OFFSET = 0.4
"""Hours between the radiation's noon and the sun's that mornings of fog, mountains and chimneys explain; half a step
more, since a row may stand for what was before it or after, and"""
ERRORS = 3.0
"""so many standard errors over days: what clouds explain."""
LEAST_DAYS = 5
JUMP = (0.6, 1.4)
"""Hours by which noon jumps where clocks change."""
LEAST_LENGTH = 0.6
"""Of the mean vector of the radiation's hours, over that of the sun's, below which it is no daylight."""
DARKEST, BRIGHTEST = 0.38, 1.12
"""Clearness that a clear sky exceeds, and never exceeds."""
DULLEST, DULL_DAYS = 0.12, 35
"""Clearness that a dull fortnight reaches at least, and days within which some sky was clear."""
CLEAR = 0.8
"""Usual clearness of a clear sky."""
_DULL = "or these weeks were dull, which `--accept radiation_unit` passes"
_WINDOW = 12
"""Days on either side of a change of clocks."""
_LIT = 0.05
"""Of the brightest moments, over the darkness of night, from which on it is light."""
_ZONES = ("Europe/Amsterdam", "America/New_York", "Australia/Sydney", "America/Santiago")
"""Whose changes of clocks are looked for where a site does not tell its zone."""


@dataclass(frozen=True)
class _Daylight:
    """Radiation by complete days."""

    day: Integers
    """Local mean solar day, from 1970, (d,)."""
    vector: NDArray[np.complex128]
    """Sum of the radiation, each row at the angle of its solar hour, (d,)."""
    total: Floats
    """Sum of the radiation, (d,)."""
    length: Floats
    """Of the mean vector of what would come without air, (d,)."""

    def offset(self) -> float:
        """Return the hours by which noon comes late by the log's clock, -12 to 12."""
        return float(np.angle(-self.vector.sum()) * 12.0 / np.pi)

    def error(self) -> float:
        """Return the standard error of the offset over days, weighted as the offset is."""
        whole = self.vector.sum()
        across = np.angle(self.vector / (whole / abs(whole))) * 12.0 / np.pi
        weight = np.abs(self.vector) / np.abs(self.vector).sum()
        return float(np.sqrt((weight**2 * across**2).sum()))


def against_the_sun(telemetry: Telemetry, site: Site) -> list[DataFault]:
    """Return what the radiation says of the clock, and the sun of the radiation's unit."""
    if "global_radiation" not in telemetry:
        return []
    values = telemetry["global_radiation"]
    if np.isfinite(values).sum() < 48 or np.nanmax(values) <= 0.0:
        return []
    summed = running_sum(telemetry.time, values)
    if summed is not None:
        return [_summed(telemetry, site, summed)]
    daylight = _daylight(telemetry.time, values, site)
    if len(daylight.day) < LEAST_DAYS:
        return []
    found = _clock(telemetry, daylight, site) or other_hemisphere(telemetry, site) or _unit(telemetry, site)
    return [found] if found is not None else []


def noon_is_late(telemetry: Telemetry, site: Site) -> float:
    """Return the hours by which noon comes late by a log's clock; inf where its radiation tells nothing."""
    if "global_radiation" not in telemetry:
        return float("inf")
    daylight = _daylight(telemetry.time, telemetry["global_radiation"], site)
    return daylight.offset() if len(daylight.day) else float("inf")


def _daylight(time: Times, values: Floats, site: Site) -> _Daylight:
    """Sum the radiation of the days of which nine tenths were read."""
    step = own_step(time)
    hour = sun.solar_hour(time, site.latitude, site.longitude)
    day = sun.solar_day(time, site.longitude)
    above = sun.extraterrestrial_radiation(time, site.latitude, site.longitude)
    first = int(day.min())
    index, count = day - first, int(day.max()) - first + 1
    known = np.isfinite(values)
    light = np.where(known, np.maximum(values, 0.0), 0.0)
    angle = np.exp(2j * np.pi * hour / 24.0)
    total = np.bincount(index, weights=light, minlength=count).astype(np.float64)
    vector = _complex_sum(index, light * angle, count)
    sky, sky_vector = np.bincount(index, weights=above, minlength=count), _complex_sum(index, above * angle, count)
    whole = np.bincount(index[known], minlength=count) >= 0.9 * 86_400.0 / step
    whole &= (total > 0.0) & (sky > 0.0)
    length = np.abs(sky_vector[whole]) / sky[whole]
    return _Daylight(first + np.flatnonzero(whole), vector[whole], total[whole], length)


def _complex_sum(index: Integers, values: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    return np.asarray(
        np.bincount(index, weights=values.real, minlength=count)
        + 1j * np.bincount(index, weights=values.imag, minlength=count)
    )


def _clock(telemetry: Telemetry, daylight: _Daylight, site: Site) -> DataFault | None:
    length = abs(daylight.vector.sum()) / daylight.total.sum()
    if length < LEAST_LENGTH * float(np.average(daylight.length, weights=daylight.total)):
        seen = "global_radiation does not follow the sun: as much of it comes by night as by day"
        mend = "its column is another quantity, or day and month of the dates are exchanged"
        return DataFault("no_daylight", "global_radiation", seen, mend)
    jump = _change_of_clocks(telemetry, site)
    if jump is not None:
        return jump
    offset = daylight.offset()
    if abs(offset) <= LARGEST_OFFSET + own_step(telemetry.time) / 7200.0 + ERRORS * daylight.error():
        return None
    hours = f"{offset:.1f} h late" if offset > 0.0 else f"{-offset:.1f} h early"
    seen = f"noon comes {hours} by the log's clock: the sun over {site.latitude:g}, {site.longitude:g} says so"
    if _fits_as_wall_time(telemetry, site):
        return DataFault("local_time", "", seen, _name_zone(site.time_zone))
    mend = "give the time zone of the export (`time_zone` in the mapping), or set right the longitude of the site"
    return DataFault("clock", "", seen, mend)


def _name_zone(zone: str) -> str:
    return (
        f"these are wall times of {zone}: say so in the mapping (time: {{time_zone: {zone}}}), "
        f"as `igrow-trainer import --time-zone {zone}` does"
    )


def _fits_as_wall_time(telemetry: Telemetry, site: Site) -> bool:
    """Tell whether the sun agrees where the times are read as wall times of the site's zone."""
    if site.time_zone == "UTC":
        return False
    time = from_local(telemetry.time, site.time_zone)
    known = ~np.isnat(time)
    daylight = _daylight(time[known], telemetry["global_radiation"][known], site)
    limit = LARGEST_OFFSET + own_step(telemetry.time) / 7200.0
    return len(daylight.day) >= LEAST_DAYS and abs(daylight.offset()) < limit


def _change_of_clocks(telemetry: Telemetry, site: Site) -> DataFault | None:
    """Return the fault of a log whose noon jumps by an hour on the day on which clocks change."""
    zones = (site.time_zone,) if site.time_zone != "UTC" else _ZONES
    changes = [(zone, day) for zone in zones for day in _changes(telemetry.time, zone)]
    if not changes:
        return None
    days, noon = _noon_by_light(telemetry.time, telemetry["global_radiation"], site)
    for zone, day in changes:
        before, after = noon[(days >= day - _WINDOW) & (days < day)], noon[(days > day) & (days <= day + _WINDOW)]
        if min(len(before), len(after)) < LEAST_DAYS:
            continue
        jump = float(after.mean() - before.mean())
        error = ERRORS * float(np.hypot(*(np.std(one, ddof=1) / np.sqrt(len(one)) for one in (before, after))))
        if max(JUMP[0], error) <= abs(jump) <= JUMP[1]:
            date = np.datetime64(int(day), "D")
            seen = f"noon jumps by {jump:+.1f} h on {date}, when clocks change in {zone}"
            return DataFault("local_time", "", seen, _name_zone(zone))
    return None


def _noon_by_light(time: Times, values: Floats, site: Site) -> tuple[Integers, Floats]:
    """Return the days of which nine tenths were read, from 1970, and the hour halfway between first and last light."""
    hour, day = sun.solar_hour(time, site.latitude, site.longitude), sun.solar_day(time, site.longitude)
    step = own_step(time) / 3600.0
    known = np.isfinite(values)
    # An hour off by the log's clock, these hours are night all the same.
    night = values[known & ((hour < 3.0) | (hour > 21.0))]
    dark = float(np.quantile(night, 0.99)) if len(night) else float(np.nanmin(values))
    lit = dark + _LIT * (float(np.quantile(values[known], 0.98)) - dark)
    found: list[tuple[int, float]] = []
    for rows in np.split(np.arange(len(time)), np.flatnonzero(np.diff(day)) + 1):
        light, hours = np.where(known[rows], values[rows], dark), hour[rows]
        bright = np.flatnonzero(light > lit)
        if known[rows].sum() < 0.9 * 24.0 / step or len(bright) == 0:
            continue
        first, last = int(bright[0]), int(bright[-1])
        begins, ends = float(hours[first]), float(hours[last])
        # Between two rows, so that hourly ones tell it as well.
        if first > 0:
            begins -= step * float((light[first] - lit) / (light[first] - light[first - 1]))
        if last < len(light) - 1:
            ends += step * float((light[last] - lit) / (light[last] - light[last + 1]))
        found.append((int(day[rows[0]]), 0.5 * (begins + ends)))
    return np.array([one for one, _ in found], dtype=np.int64), np.array([noon for _, noon in found])


def _changes(time: Times, zone: str) -> list[int]:
    """Return the days, from 1970, on which clocks change in a zone within a log."""
    first, last = (int(edge.astype("datetime64[D]").astype(np.int64)) for edge in (time[0], time[-1]))
    days = np.arange(first, last + 1)
    noon: Times = (days * 86_400 + 43_200).astype("datetime64[s]")
    offset = (to_local(noon, zone) - noon).astype(np.int64)
    return [int(day) for day in days[1:][np.diff(offset) != 0]]


def _clearness(telemetry: Telemetry, site: Site) -> float | None:
    """Return the clearness of the clearest moments (98 % quantile), or None where the sun is never high enough."""
    time, values = telemetry.time, telemetry["global_radiation"]
    half = np.timedelta64(int(own_step(time) / 2.0), "s")
    # A row may stand for the interval before it or after: the brighter sky of both is the one not exceeded.
    above = np.max(
        [sun.extraterrestrial_radiation(time + shift, site.latitude, site.longitude) for shift in (-half, half)], axis=0
    )
    high = (above > 200.0) & np.isfinite(values)
    if high.sum() < 100:
        return None
    return float(np.quantile(values[high] / above[high], 0.98))


def _unit(telemetry: Telemetry, site: Site) -> DataFault | None:
    clearness = _clearness(telemetry, site)
    if clearness is None or DARKEST <= clearness <= BRIGHTEST or clearness <= 0.0:
        return None
    step = own_step(telemetry.time)
    smaller = {
        f"J cm-2 a row ({step / 60.0:g} min)": Remedy(1e4, amount="interval"),
        "klux": Remedy(1000.0 / 115.0),
        "kW m-2": Remedy(1000.0),
        "J cm-2 an hour": Remedy(1e4 / 3600.0),
    }
    larger = {
        "umol m-2 s-1 of PAR": Remedy(1.0 / 2.05),
        "kJ m-2 an hour": Remedy(1.0 / 3.6),
        "lux": Remedy(1.0 / 115.0),
    }

    def within(least: float, most: float) -> dict[str, Remedy]:
        """Return the units in which the clearest moments lie within these bounds."""
        return {
            name: remedy
            for name, remedy in (smaller if clearness < DARKEST else larger).items()
            if least <= clearness * remedy.scale / (step if remedy.amount == "interval" else 1.0) <= most
        }

    part = "never more than" if clearness < DARKEST else "up to"
    seen = f"global_radiation is {part} {clearness:.2g} of what comes from the sun, where a clear sky lets 0.8 through"
    # In dull weeks no sky was clear: then a unit may make less of it than that, and W m-2 may have been so little.
    dull = clearness < DARKEST and len(np.unique(telemetry.time.astype("datetime64[D]"))) < DULL_DAYS
    possible = within(0.55 * CLEAR, 1.5 * CLEAR) or within(DULLEST, 0.55 * CLEAR)
    if not possible:
        mend = "it is not in W m-2: give its scale in the mapping"
        return DataFault("radiation_unit", "global_radiation", seen, mend)
    mend = " or ".join(
        f"in {name}, then {{amount: {remedy.amount}, scale: {remedy.scale:.6g}}}" for name, remedy in possible.items()
    )
    mend = f"it is {mend} in the mapping"
    if dull and clearness >= DULLEST:
        return DataFault("radiation_unit", "global_radiation", seen, "; ".join((mend, _DULL)))
    only = next(iter(possible.values())) if len(possible) == 1 else None
    return DataFault("radiation_unit", "global_radiation", seen, mend, only)


def _summed(telemetry: Telemetry, site: Site, kind: Literal["day", "total"]) -> DataFault:
    """Return the fault of a radiation that is a running sum, with the unit of the sum by its size."""
    time, values = telemetry.time, telemetry["global_radiation"]
    day = sun.solar_day(time, site.longitude)
    above = sun.extraterrestrial_radiation(time, site.latitude, site.longitude) * own_step(time)
    first, count = int(day.min()), int(day.max()) - int(day.min()) + 1
    gain = np.concatenate([[0.0], np.maximum(np.diff(np.nan_to_num(values)), 0.0)])
    came = np.bincount(day - first, weights=gain, minlength=count)
    sky = np.bincount(day - first, weights=above, minlength=count)
    whole = (np.bincount(day - first, minlength=count) >= 0.9 * 86_400.0 / own_step(time)) & (sky > 0.0)
    seen = "global_radiation only grows " + ("from midnight on" if kind == "day" else "all along") + ": it is a sum"
    mend = "in the mapping: global_radiation: {column: ..., amount: " + kind + ", scale: "
    if whole.any():
        clearest = float(np.quantile(came[whole] / sky[whole], 0.9))
        units = {"J cm-2": 1e4, "Wh m-2": 3600.0, "MJ m-2": 1e6, "kJ m-2": 1e3}
        name = min(units, key=lambda one: abs(np.log(max(clearest, 1e-12) * units[one] / 0.6)))
        if 0.25 < clearest * units[name] < 0.9:
            return DataFault(
                "radiation_sum", "global_radiation", f"{seen}, by its size in {name}", f"{mend}{units[name]:g}}}",
                Remedy(units[name], amount=kind),
            )  # fmt: skip
    return DataFault("radiation_sum", "global_radiation", seen, f"{mend}...}} with the joules m-2 of its unit")
