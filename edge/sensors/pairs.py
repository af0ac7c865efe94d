"""Checks of one sensor against others: what cannot be true together.

Each check blames one sensor, and only when every other sensor that it leans on is good. The limits are wide: a
check that cries wolf takes a working sensor out of control.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass

from igrow.core import air
from igrow.core.quantities import difference_with_unit, number_with_unit, with_unit
from igrow.edge.image import Quality, Value


@dataclass(frozen=True, slots=True)
class PairContext:
    """What a check may look at."""

    values: Mapping[str, Value]
    sun_elevation: float | None
    """Degrees; None while the time of day is not known."""

    def good(self, *names: str) -> tuple[float, ...] | None:
        """Return the numbers of these points when all of them are good, else None."""
        found = []
        for name in names:
            value = self.values.get(name)
            if value is None or value.quality is not Quality.GOOD or value.value is None:
                return None
            found.append(value.value)
        return tuple(found)


@dataclass(frozen=True)
class PairCheck:
    """One contradiction: who is blamed, and the test that returns a line for people or an empty string."""

    blames: str
    test: Callable[[PairContext], str]


def _light_by_night(context: PairContext) -> str:
    radiation = context.good("global_radiation")
    if radiation is None or context.sun_elevation is None or context.sun_elevation > -6.0 or radiation[0] < 50.0:
        return ""
    sun = with_unit("global_radiation", radiation[0], ".0f")
    depth = number_with_unit(-context.sun_elevation, "deg", ".0f")
    return f"{sun} of sun with the sun {depth} below the horizon"


def _par_without_light(context: PairContext) -> str:
    found = context.good("par", "global_radiation", "lamp_power")
    if found is None:
        return ""
    par, radiation, lamps = found
    # The brightest full moon gives less than 0.01 umol m-2 s-1.
    dark = par > 50 and radiation < 5 and lamps < 1
    return f"{with_unit('par', par, '.0f')} with no sun and no lamps" if dark else ""


def _vents_wide(context: PairContext) -> bool:
    vents = context.good("vent_lee", "vent_wind")
    return vents is not None and min(vents) >= 80.0


def _warm_through_open_vents(context: PairContext) -> str:
    found = context.good("air_temperature", "outdoor_temperature")
    if found is None or not _vents_wide(context):
        return ""
    inside, outside = found
    if -12.0 <= inside - outside <= 20.0:
        return ""
    here, there = with_unit("air_temperature", inside, ".1f"), with_unit("outdoor_temperature", outside, ".1f")
    return f"{here} inside and {there} outside with all vents wide open"


def _humid_through_open_vents(context: PairContext) -> str:
    found = context.good("air_temperature", "air_humidity", "outdoor_temperature", "outdoor_humidity")
    if found is None or not _vents_wide(context):
        return ""
    inside = float(air.vapour_concentration(math, found[0], found[1])) * 1000.0
    outside = float(air.vapour_concentration(math, found[2], found[3])) * 1000.0
    # A full crop in full sun lifts the vapour content by some 8 g m-3 at the ventilation of open vents.
    if -5.0 <= inside - outside <= 14.0:
        return ""
    here, there = (number_with_unit(one, "g m-3", ".0f") for one in (inside, outside))
    return f"{here} of vapour inside and {there} outside with all vents wide open"


PAIR_CHECKS: Sequence[PairCheck] = (
    PairCheck("global_radiation", _light_by_night),
    PairCheck("par", _par_without_light),
    PairCheck("air_temperature", _warm_through_open_vents),
    PairCheck("air_humidity", _humid_through_open_vents),
)


def suspects(checks: Sequence[PairCheck], context: PairContext) -> Iterator[tuple[str, str]]:
    """Yield (point, why) for each contradiction, all judged on the same values."""
    found = [(check.blames, check.test(context)) for check in checks if check.blames in context.values]
    return ((name, why) for name, why in found if why)


@dataclass(frozen=True)
class TwinSensors:
    """Two sensors of the same thing: they check each other, and the second stands in for a bad first."""

    first: str
    second: str
    tolerance: float
    """Largest difference of two working sensors, in their unit."""

    def compare(self, values: MutableMapping[str, Value]) -> None:
        """Judge the pair in place; nothing happens when one of the two points is not there."""
        first, second = values.get(self.first), values.get(self.second)
        if first is None or second is None:
            return
        if second.quality is not Quality.GOOD or second.value is None:
            return
        if first.quality is not Quality.GOOD or first.value is None:
            why = f"stands in for {self.first} ({first.quality.value}: {first.why})"
            values[self.first] = Value(second.value, Quality.GOOD, second.age, f"{self.second} {why}")
            return
        difference = abs(first.value - second.value)
        if difference > self.tolerance:
            apart, most = (difference_with_unit(self.first, one) for one in (difference, self.tolerance))
            why = f"{self.first} and {self.second} differ by {apart}, more than {most}"
            values[self.first] = Value(first.value, Quality.IMPLAUSIBLE, first.age, why)
            values[self.second] = Value(second.value, Quality.IMPLAUSIBLE, second.age, why)
