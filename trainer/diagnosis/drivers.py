"""What a cause without a name may hang on: exogenous drivers only - clock, calendar, weather and schedules.

Feedback control reveals disturbances, so that a learner who sees states or what the PLC controls by them (heat,
vents, CO2) finds structure in pure noise. Nothing here reads either.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from igrow.core import sun
from igrow.core.simulator.hybrid.record import SWITCHES, Record
from igrow.trainer.diagnosis.linearisation import Floats, Linearisation, flux_columns

UNIT_FLUX: Mapping[str, float] = {
    "heat": 10.0,
    "vapour": 2e-6,
    "co2": 3e-7,
    "air_exchange": 5e-4,
    "light_loss": 0.1,
}
"""Size of one unit of a pattern in each channel: W m-2, kg m-2 s-1, kg m-2 s-1, m s-1, 1."""
BALANCES_OF: Mapping[str, tuple[str, ...]] = {
    "heat": ("heat",),
    "vapour": ("vapour",),
    "co2": ("co2",),
    "air_exchange": ("heat", "vapour", "co2"),
    "light_loss": ("light", "heat"),
}
_WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")


@dataclass(frozen=True)
class Pattern:
    """A course in time that exogenous drivers alone determine, in one channel."""

    channel: str
    when: str
    """For people: at which hours, days or weather."""
    drivers: tuple[str, ...]


def patterns(record: Record, longitude: float) -> list[tuple[str, tuple[str, ...], Floats]]:
    """Return (when, drivers, course (n,)) of every pattern, without the channel."""
    hour = np.asarray(record.inputs["hour"])
    weekday = sun.weekday(sun.solar_day(record.time, longitude))
    working: Floats = (weekday < 5).astype(np.float64)
    table: list[tuple[str, tuple[str, ...], Floats]] = []

    def window(first: float, last: float) -> Floats:
        inside = (hour >= first) & (hour < last) if first < last else (hour >= first) | (hour < last)
        return inside.astype(np.float64)

    for first, last in [(h, h + 2) for h in range(0, 24, 2)] + [(5, 9), (7, 16), (11, 14), (11, 17), (19, 5), (19, 11)]:
        text = f"{first:02d} to {last:02d} h"
        table.append((text, ("hour",), window(first, last)))
        if (first, last) in {(5, 9), (7, 16), (11, 14)}:
            table.append((f"{text} on working days", ("hour", "weekday"), window(first, last) * working))
    table.append(("working days", ("weekday",), working))
    for index, name in enumerate(_WEEKDAYS):
        for first, last in ((0, 6), (6, 10), (10, 14), (14, 19), (19, 24)):
            course: Floats = window(first, last) * (weekday == index).astype(np.float64)
            table.append((f"{first:02d} to {last:02d} h on {name}s", ("hour", "weekday"), course))
    outdoor = np.asarray(record.inputs["outdoor_temperature"], dtype=np.float64)
    cold: Floats = np.maximum(8.0 - outdoor, 0.0) / 8.0
    table.append(("cold weather", ("outdoor_temperature",), cold))
    table.append(("outdoor temperature", ("outdoor_temperature",), (outdoor - 10.0) / 10.0))
    for first, last in ((5, 9), (9, 15), (19, 5), (19, 11)):
        text = f"cold weather, {first:02d} to {last:02d} h"
        table.append((text, ("outdoor_temperature", "hour"), cold * window(first, last)))
    for name, scale in (("wind_speed", 5.0), ("global_radiation", 300.0), ("rain", 1.0)):
        if name not in record.unknown:
            weather: Floats = np.asarray(record.inputs[name], dtype=np.float64) / scale
            table.append((name.replace("_", " "), (name,), weather))
    if "outdoor_humidity" not in record.unknown:
        table.append(
            ("dry weather", ("outdoor_humidity",), (80.0 - np.asarray(record.inputs["outdoor_humidity"])) / 20.0)
        )
    if "rain" not in record.unknown:
        fallen = np.cumsum(np.asarray(record.inputs["rain"])) * record.step / 72_000.0
        table.append(("until rain has fallen", ("rain",), np.exp(-fallen)))
    # Lamps and irrigation follow the clock and the light, not the climate that they are to be blamed for.
    for name, usual in (("lamp_power", 80.0), ("irrigation", 1.0)):
        driver, scale = (SWITCHES[name], 1.0) if name in record.unknown else (name, usual)
        if np.any(record.inputs.get(driver, 0.0)):
            running: Floats = np.asarray(record.inputs[driver], dtype=np.float64) / scale
            text = driver.replace("_", " ")
            table.append((text if driver == SWITCHES[name] else f"{text} on", (driver,), running))
            keep = float(np.exp(-record.step / 3600.0))
            late: Floats = lfilter([1.0 - keep], [1.0, -keep], running)
            table.append((f"an hour after {text}", (driver,), late))
    days = np.arange(len(record)) * record.step / 86_400.0
    month: Floats = np.asarray(days / 30.0, dtype=np.float64)
    table.append(("from day to day", ("time",), month))
    table.append(("all the time", (), np.ones(len(record))))
    return table


def pattern_fluxes(record: Record, longitude: float, amplitudes: Mapping[tuple[str, str], float]) -> dict[str, Floats]:
    """Return the fluxes of patterns by channel, (n,).

    Args:
        record: of the log.
        longitude: degrees east.
        amplitudes: in units of `UNIT_FLUX`, by (channel, when).
    """
    fluxes: dict[str, Floats] = {}
    for when, _, course in patterns(record, longitude):
        for channel, size in UNIT_FLUX.items():
            amplitude = amplitudes.get((channel, when), 0.0)
            if amplitude:
                fluxes[channel] = fluxes.get(channel, 0.0) + amplitude * size * course
    return fluxes


def pattern_columns(line: Linearisation, longitude: float) -> tuple[tuple[Pattern, ...], Floats]:
    """Return every pattern in every channel, and their columns of the errors, (p, 3, r, steps)."""
    found: list[Pattern] = []
    fluxes: list[tuple[Mapping[str, Floats], float]] = []
    for when, drivers, course in patterns(line.record, longitude):
        if not np.any(course):
            continue
        for channel, size in UNIT_FLUX.items():
            found.append(Pattern(channel, when, drivers))
            fluxes.append(({channel: size * course}, 0.1))
    columns = flux_columns(line, fluxes)
    kept = [index for index, column in enumerate(columns) if np.any(np.abs(column[line.runs.weight]) > 1e-9)]
    return tuple(found[index] for index in kept), columns[kept]
