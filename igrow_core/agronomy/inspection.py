"""Looks at a course of setpoints as a whole and says which limits it leaves: what `hold` must never let pass.

Written apart from `hold`, from the definitions of the limits and not from the steps that keep them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from igrow.core.agronomy.moment import Place, moment
from igrow.core.arrays import Floats

_SLACK = 1e-6
QUARTER = 900.0
"""Seconds by which rows are parted where a local day begins."""


def violations(
    place: Place,
    start: float,
    heating: Floats,
    lamp: Floats,
    co2: Floats,
    sunlight: Floats,
    step: float = 3600.0,
    ventilation: Floats | None = None,
) -> list[str]:
    """Return one sentence for each limit that a course leaves, in the order of time.

    Args:
        place: with its limits.
        start: seconds since 1970 UTC at which the first row begins.
        heating: setpoint of each row, degC, (H,).
        lamp: 0 to 1, (H,).
        co2: ppm, (H,).
        sunlight: mol m-2 above the crop in each row, (H,).
        step: seconds for which a row stands.
        ventilation: setpoint of each row, degC, (H,), where the PLC takes one.

    Nights and local days that the course does not hold as a whole are not judged by their sums.
    """
    times: Floats = start + step * np.arange(len(heating), dtype=np.float64)
    return [
        *_temperatures(place, times, heating, step),
        *_days(place, times, heating, lamp, sunlight, step),
        *_nights(place, times, lamp, step),
        *_people(place, times, co2, step),
        *_rests(place, lamp, step),
        *(() if ventilation is None else _dead_zone(place, heating, ventilation)),
    ]


def _temperatures(place: Place, times: Floats, heating: Floats, step: float) -> Iterator[str]:
    limits = place.limits
    for row, (time, value) in enumerate(zip(times.tolist(), heating.tolist(), strict=True)):
        # The sun may rise or set while a row stands.
        for up in {moment(place, time).sun_up, moment(place, time + step - 1.0).sun_up}:
            band = limits.day_temperature if up else limits.night_temperature
            if not band.low - _SLACK <= value <= band.high + _SLACK:
                yield f"row {row}: {value:.3f} degC by {'day' if up else 'night'}"
        if row and abs(value - heating[row - 1]) > place.drift * step / 3600.0 + _SLACK:
            yield f"row {row}: {value - heating[row - 1]:+.3f} K at once"


def _dead_zone(place: Place, heating: Floats, ventilation: Floats) -> Iterator[str]:
    for row in np.flatnonzero(ventilation - heating < place.limits.dead_zone - _SLACK).tolist():
        yield f"row {row}: vents open at {ventilation[row]:.3f} degC, heated to {heating[row]:.3f}"


def _days(place: Place, times: Floats, heating: Floats, lamp: Floats, sunlight: Floats, step: float) -> Iterator[str]:
    limits, mean = place.limits, place.limits.mean_temperature
    parts = max(1, round(step / QUARTER))
    fine = np.repeat(times, parts) + np.tile(step / parts * np.arange(parts), len(times))
    days = np.array([moment(place, time).day for time in fine.tolist()])
    for day in np.unique(days).tolist():
        rows = np.flatnonzero(days == day) // parts
        whole = moment(place, float(fine[days == day][0]))
        if rows[0] == 0 or len(rows) < round((whole.hour + whole.hours_left) * 3600.0 * parts / step):
            continue
        values = heating[rows]
        if not mean.low - _SLACK <= values.mean() <= mean.high + _SLACK:
            yield f"day {day}: a mean of {values.mean():.4f} degC"
        if values.max() - values.min() > limits.temperature_difference + _SLACK:
            yield f"day {day}: {values.max() - values.min():.3f} K between highest and lowest"
        lamps = place.lamp_light * lamp[rows].sum() * step / parts / 3600.0
        light = lamps + sunlight[rows].sum() / parts
        if lamps > 0.0 and light > limits.light_sum_high + _SLACK:
            yield f"day {day}: {light:.2f} mol m-2, of them {lamps:.2f} from lamps"


def _nights(place: Place, times: Floats, lamp: Floats, step: float) -> Iterator[str]:
    moments = [moment(place, time) for time in (*times.tolist(), float(times[-1]) + step)]
    for night, group in groupby(moments, key=lambda one: one.night):
        one = next(group)
        begins, ends = one.night_begins, one.night_ends
        if begins < times[0] or ends > times[-1] + step:
            continue
        longest = dark = 0.0
        for time, level in zip(times.tolist(), lamp.tolist(), strict=True):
            under = max(0.0, min(time + step, ends) - max(time, begins)) / 3600.0
            dark = dark + under if level <= 0.0 else 0.0
            longest = max(longest, dark)
        needed = min(place.limits.dark_hours, (ends - begins) / 3600.0)
        if longest < needed - 1e-3:
            yield f"night {night}: dark for {longest:.2f} h, {needed:.2f} h are needed"


def _people(place: Place, times: Floats, co2: Floats, step: float) -> Iterator[str]:
    limits = place.limits
    for row, (time, value) in enumerate(zip(times.tolist(), co2.tolist(), strict=True)):
        for clock in (moment(place, time).clock, moment(place, time + step - 1.0).clock):
            begins, ends = (one.hour + one.minute / 60.0 for one in (limits.people_from, limits.people_until))
            inside = begins <= clock < ends if begins <= ends else clock >= begins or clock < ends
            if inside and value > limits.co2_with_people + _SLACK:
                yield f"row {row}: {value:g} ppm with people inside"


def _rests(place: Place, lamp: Floats, step: float) -> Iterator[str]:
    rest = place.limits.rest.get("lamp_on")
    if rest is None:
        return
    runs: Sequence[tuple[bool, int]] = [(lit, len(list(group))) for lit, group in groupby(lamp > 0.0)]
    # What runs at the beginning began before, what runs at the end goes on.
    for lit, rows in runs[1:-1]:
        least = (rest.on if lit else rest.off).total_seconds()
        if rows * step < least - _SLACK:
            yield f"lamps {'on' if lit else 'off'} for {rows * step / 3600.0:g} h only"
