"""The nearest setpoints that leave no limit, decided at an instant for the step that follows.

Each limit is kept by looking ahead as far as it can bind: bounds of the night are approached at the drift before the
sun sets, the mean of a day keeps what the rest of the day can still make good, lamps go out while the night still
holds the dark hours. So a decision that is allowed never leads where none would be.

Where the present is outside already (another plan, a hand, a limit that was just written down), the setpoint comes
back at the drift.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy.memory import LONG_AGO, Memory, at
from igrow.core.agronomy.moment import TOMORROW, Moment, Place
from igrow.core.arrays import Array

_EPSILON = 1e-9

DARK, LIGHT, REST, DEAD_ZONE = "dark_hours", "light_sum_high", "rest", "dead_zone"


@dataclass(frozen=True)
class SunToCome:
    """Light that the sun is still expected to give above the crop, mol m-2."""

    today: float
    """On what is left of this local day."""
    tomorrow: float


NO_SUN = SunToCome(0.0, 0.0)


@dataclass(frozen=True)
class Held:
    """What may stand during the next step."""

    setpoints: Mapping[str, Array]
    binding: Mapping[str, tuple[tuple[str, NDArray[np.bool_]], ...]]
    """By setpoint that was changed: the limits at work by name, and for which candidates."""

    def limits(self, name: str) -> tuple[str, ...]:
        """Return the limits that changed one setpoint for any candidate."""
        return tuple(limit for limit, which in self.binding.get(name, ()) if bool(np.any(which)))


def hold(
    place: Place, memory: Memory, now: Moment, wanted: Mapping[str, Array], hours: float, sun: SunToCome = NO_SUN
) -> Held:
    """Return the setpoints nearest to `wanted` that leave no limit.

    Args:
        place: with its limits.
        memory: of what stood until `now`.
        now: when they are to begin to stand.
        wanted: setpoints by name, each a float or (B,); those without a limit pass.
        hours: until the next decision, more than none.
        sun: light that is still expected.
    """
    memory = at(memory, now)
    setpoints = dict(wanted)
    binding: dict[str, tuple[tuple[str, NDArray[np.bool_]], ...]] = {}
    rules = {"heating_setpoint": _heating, "lamp_on": _lamps, "irrigation_on": _irrigation, "co2_setpoint": _co2}
    for name, rule in rules.items():
        if name in wanted:
            value, found = rule(place, memory, now, np.asarray(wanted[name], dtype=np.float64), hours, sun)
            setpoints[name] = value
            kept = tuple((limit, which) for limit, which in found if np.any(which))
            if kept:
                binding[name] = kept
    if "ventilation_setpoint" in wanted:
        heating = np.asarray(setpoints.get("heating_setpoint", memory.heating), dtype=np.float64)
        asked = np.asarray(wanted["ventilation_setpoint"], dtype=np.float64)
        # A heating setpoint that is not known bounds nothing.
        setpoints["ventilation_setpoint"] = np.fmax(asked, heating + place.limits.dead_zone)
        raised = setpoints["ventilation_setpoint"] > asked
        if np.any(raised):
            binding["ventilation_setpoint"] = ((DEAD_ZONE, raised),)
    return Held(setpoints, binding)


_Found = list[tuple[str, NDArray[np.bool_]]]


def _heating(
    place: Place, memory: Memory, now: Moment, wanted: Array, hours: float, _: SunToCome
) -> tuple[Array, _Found]:
    limits, drift, anchor = place.limits, place.drift, place.limits.anchor
    band, other = limits.day_temperature, limits.night_temperature
    if not now.sun_up:
        band, other = other, band
    # Bounds change hands with the sun; before it they come no nearer than the drift can follow.
    reach = _reach(drift, hours, now.hours_to_change)
    tomorrow = _reach(drift, hours, now.hours_left)
    whole = now.hour + now.hours_left
    expected = memory.heat_sum + max(whole - memory.heat_hours, 0.0) * anchor
    mean = limits.mean_temperature
    bounds: list[tuple[str, Array, Array]] = [
        ("day_temperature" if now.sun_up else "night_temperature", band.low, band.high),
        ("night_temperature" if now.sun_up else "day_temperature", other.low - reach, other.high + reach),
        ("mean_temperature", anchor - _room(expected - whole * mean.low, drift, hours),
         anchor + _room(whole * mean.high - expected, drift, hours)),
        ("mean_temperature", anchor - _room(23.0 * (anchor - mean.low), drift, hours) - tomorrow,
         anchor + _room(23.0 * (mean.high - anchor), drift, hours) + tomorrow),
        ("temperature_difference", np.maximum(memory.highest, anchor) - limits.temperature_difference,
         np.minimum(memory.lowest, anchor) + limits.temperature_difference),
    ]  # fmt: skip
    value: Array = wanted
    found: _Found = []
    for name, low, high in bounds:
        held = np.minimum(np.maximum(value, low), high)
        found.append((name, held != value))
        value = held
    before: Array = np.where(np.isnan(memory.heating), value, memory.heating)
    held = np.clip(value, before - drift * hours, before + drift * hours)
    # Drift stood in the way only where it kept the setpoint from what was wanted, not from another limit's bound.
    found.append(("temperature_drift", (held != value) & (value == wanted)))
    return held, found


def _reach(drift: float, hours: float, ahead: float) -> float:
    """Return how far the setpoint can still be moved, K, in decisions of `hours` that end before `ahead` hours."""
    return min(drift * hours * math.floor(ahead / hours + _EPSILON), 1e3)


def _room(credit: Array, drift: float, hours: float) -> Array:
    """Return how far off the anchor a setpoint may stand for a step, K, where `credit` K h may be used up in all.

    Coming back at the drift uses x^2 / (2 drift) more than the x hours of the step itself.
    """
    step = drift * hours
    return np.where(credit > 0.0, np.sqrt(step * step + 2.0 * drift * np.maximum(credit, 0.0)) - step, 0.0)


def _lamps(
    place: Place, memory: Memory, now: Moment, wanted: Array, hours: float, sun: SunToCome
) -> tuple[Array, _Found]:
    limits = place.limits
    rest = limits.rest.get("lamp_on")
    least_on = rest.on.total_seconds() / 3600.0 if rest else 0.0
    before, since = memory.level.get("lamp_on", 0.0), memory.since.get("lamp_on", LONG_AGO)
    lit = np.asarray(before) > 0.0
    # Lamps that go on must be able to stay on for their least time, in whole steps.
    lasting = np.where(lit, least_on - since, least_on)
    burning = hours * np.maximum(np.ceil(lasting / hours - _EPSILON), 1.0)
    must_rest = ~_dark_enough(place, memory, now, burning)
    burning_today = np.minimum(burning, now.hours_left)
    today = memory.light + sun.today + place.lamp_light * burning_today
    tomorrow = sun.tomorrow + place.lamp_light * (burning - burning_today)
    too_bright = (today > limits.light_sum_high) | ((burning > burning_today) & (tomorrow > limits.light_sum_high))
    forced = must_rest | too_bright
    value, rested = _rested(wanted, before, since, least_on, rest.off.total_seconds() / 3600.0 if rest else 0.0)
    held = np.where(forced, 0.0, value)
    burns = np.asarray(value) > 0.0
    return held, [(DARK, must_rest & burns), (LIGHT, too_bright & burns), (REST, rested & (held == value))]


def _dark_enough(place: Place, memory: Memory, now: Moment, burning: Array) -> NDArray[np.bool_]:
    """Tell whether lamps may burn for `burning` hours, (B,), and the night still gives its dark hours."""
    end = now.seconds + 3600.0 * np.asarray(burning)
    begins, ends, darkest = now.night_begins, now.night_ends, np.asarray(memory.darkest)
    if now.seconds >= ends:
        # The morning belongs to the night before; the next one is much the same.
        begins, ends, darkest = begins + TOMORROW, ends + TOMORROW, np.asarray(0.0)
    needed = min(place.limits.dark_hours, (ends - begins) / 3600.0)
    left = (ends - np.maximum(end, begins)) / 3600.0
    return np.asarray((darkest >= needed - 1e-6) | (left >= needed - 1e-6))


def _irrigation(
    place: Place, memory: Memory, now: Moment, wanted: Array, hours: float, _: SunToCome
) -> tuple[Array, _Found]:
    rest = place.limits.rest.get("irrigation_on")
    if rest is None:
        return wanted, []
    before, since = memory.level.get("irrigation_on", 0.0), memory.since.get("irrigation_on", LONG_AGO)
    least = (rest.on.total_seconds() / 3600.0, rest.off.total_seconds() / 3600.0)
    value, rested = _rested(wanted, before, since, *least)
    return value, [(REST, rested)]


def _rested(wanted: Array, before: Array, since: Array, on: float, off: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the level where what was switched stays so for its least time, and where that changed it."""
    lit = np.asarray(before) > 0.0
    stays_on = lit & (np.asarray(since) < on - _EPSILON) & (wanted <= 0.0)
    stays_off = ~lit & (np.asarray(since) < off - _EPSILON) & (wanted > 0.0)
    value = np.where(stays_on, before, np.where(stays_off, 0.0, wanted))
    return value, stays_on | stays_off


def _co2(place: Place, memory: Memory, now: Moment, wanted: Array, hours: float, _: SunToCome) -> tuple[Array, _Found]:
    limits = place.limits
    begins, ends = (one.hour + one.minute / 60.0 for one in (limits.people_from, limits.people_until))
    if begins <= ends:
        inside = (now.clock < ends and now.clock + hours > begins) or now.clock + hours > 24.0 + begins
    else:  # a night shift
        inside = now.clock < ends or now.clock + hours > begins
    high = limits.co2_with_people if inside else np.inf
    return np.minimum(wanted, high), [("co2_with_people", wanted > high)]


def sun_to_come(now: Moment, times: NDArray[np.float64], light: NDArray[np.float64]) -> SunToCome:
    """Return what the sun is still expected to give.

    `times` (H,) are seconds since 1970 UTC at which hours begin, `light` (H,) what the sun gives in each, mol m-2.
    """
    midnight = now.seconds + 3600.0 * now.hours_left
    today = np.clip((midnight - times) / 3600.0, 0.0, 1.0)
    tomorrow = np.clip((midnight + 86_400.0 - times) / 3600.0, 0.0, 1.0) - today
    ahead = light * (times + 3600.0 > now.seconds)
    return SunToCome(float(np.sum(today * ahead)), float(np.sum(tomorrow * ahead)))
