"""Columns in each other's place, and screens the other way round."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from igrow.core import sun
from igrow.core.arrays import Floats, Integers
from igrow.core.quantities import difference_with_unit
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault, Remedy
from igrow.trainer.data.plausibility.units import readings

SWAPPED_ALIKE = 3.0
"""K by which the nights outside are warmer than those inside, in columns that stand in each other's place."""
_LEAST_NIGHTS = 5
CLOSED_IN_LIGHT, CLOSED_BY_DAY, OPEN_AT_NIGHT = 90.0, 75.0, 40.0
"""% closed. A screen that is more than the first in bright light is read the wrong way, and so is one that is more than
the second there and less than the third in the dark."""
BRIGHT = 200.0
"""W m-2."""
_LEAST_ROWS = 48
WARM_NIGHT = 14.0
"""degC outside: below it a screen that is there would be closed at night, not by day."""


def swapped(telemetry: Telemetry, site: Site | None, wrong_unit: Collection[str]) -> list[DataFault]:
    """Return pairs of columns that stand in each other's place, where that is certain."""
    found = []
    for place in ("air", "outdoor"):
        one, other = _median(telemetry, f"{place}_temperature"), _median(telemetry, f"{place}_humidity")
        if one is not None and other is not None and 45.0 < one <= 100.0 and 1.5 < other < 42.0:
            seen = f"{place}_temperature has a median of {one:.3g} and {place}_humidity of {other:.3g}"
            found.append(_swap(f"{place}_temperature", f"{place}_humidity", seen))
    humidity, carbon = _median(telemetry, "air_humidity"), _median(telemetry, "air_co2")
    if humidity is not None and carbon is not None and humidity > 250.0 and carbon <= 101.0:
        found.append(
            _swap("air_humidity", "air_co2", f"air_humidity has a median of {humidity:.3g}, air_co2 of {carbon:.3g}")
        )
    if site is not None and not {"air_temperature", "outdoor_temperature"} & set(wrong_unit):
        found += _inside_out(telemetry, site)
    return found


def _swap(one: str, other: str, seen: str) -> DataFault:
    mend = "they stand in each other's place: exchange the two columns in the mapping"
    return DataFault("swapped_columns", f"{one}, {other}", seen, mend)


def _inside_out(telemetry: Telemetry, site: Site) -> list[DataFault]:
    """Tell whether the air inside is the one that is colder at night and follows the weather."""
    if "air_temperature" not in telemetry or "outdoor_temperature" not in telemetry:
        return []
    dark = sun.elevation(telemetry.time, site.latitude, site.longitude) < -6.0
    day = sun.solar_day(telemetry.time, site.longitude)[dark]
    inside, outside = (_by_day(day, telemetry[name][dark]) for name in ("air_temperature", "outdoor_temperature"))
    both = np.isfinite(inside) & np.isfinite(outside)
    inside, outside = inside[both], outside[both]
    if len(inside) < _LEAST_NIGHTS:
        return []
    warmer = float(np.median(outside - inside))
    # What is held varies less from night to night than the weather.
    if warmer > SWAPPED_ALIKE and (outside > inside).mean() > 0.9 and np.std(outside) < 0.7 * np.std(inside):
        warmth = difference_with_unit("air_temperature", warmer, ".1f")
        seen = f"nights are {warmth} warmer outside than inside, and differ less from one to the next"
        return [_swap("air_temperature", "outdoor_temperature", seen)]
    return []


def _by_day(day: Integers, values: Floats) -> Floats:
    """Return the mean of each day, (days,), NaN without a reading."""
    if len(day) == 0:
        return np.empty(0)
    index = day - day.min()
    known = np.isfinite(values)
    count = np.bincount(index[known], minlength=int(index.max()) + 1)
    total = np.bincount(index[known], weights=values[known], minlength=len(count))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def screens_reversed(telemetry: Telemetry, site: Site) -> list[DataFault]:
    """Return the screens that are closed in bright light and open in cold nights: their 100 means open."""
    elevation = sun.elevation(telemetry.time, site.latitude, site.longitude)
    bright = elevation > 15.0
    if "global_radiation" in telemetry:
        seen = np.nan_to_num(telemetry["global_radiation"]) > BRIGHT
        # A radiation in another unit is never so bright.
        bright = seen if seen.sum() >= _LEAST_ROWS else bright
    dark = elevation < -6.0
    if "outdoor_temperature" in telemetry:
        dark &= np.nan_to_num(telemetry["outdoor_temperature"], nan=WARM_NIGHT) < WARM_NIGHT
    found = []
    for name in ("energy_screen", "blackout_screen"):
        if name not in telemetry:
            continue
        values = telemetry[name]
        by_day, at_night = values[bright & np.isfinite(values)], values[dark & np.isfinite(values)]
        if min(len(by_day), len(at_night)) < _LEAST_ROWS:
            continue
        day, night = float(by_day.mean()), float(at_night.mean())
        if day > CLOSED_IN_LIGHT or (day > CLOSED_BY_DAY and night < OPEN_AT_NIGHT):
            what = f"in bright light, {night:.0f} % at night"
            reverse = Remedy(-1.0, 100.0)
            mend = f"its 100 means open; in the mapping: {name}: {{column: ..., scale: -1, offset: 100}}"
            found.append(DataFault("screen_reversed", name, f"{name} is {day:.0f} % closed {what}", mend, reverse))
    return found


def _median(telemetry: Telemetry, name: str) -> float | None:
    values = readings(telemetry, name)
    return float(np.median(values)) if len(values) else None
