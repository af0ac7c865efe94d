"""Weather over the horizon: a forecast where there is one, else the persistence of the last days."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES, WEATHER
from igrow.core.telemetry import Telemetry, to_grid
from igrow.edge.hand_off import HandOff, LateError
from igrow.edge.planning.open_meteo import read_forecast

NEEDED = WEATHER[:6]
"""The weather that plans are made from, in the registry's order."""
LOWEST, HIGHEST = (np.array([getattr(QUANTITIES[name], end) for name in NEEDED]) for end in ("low", "high"))
"""What no weather leaves."""
HOUR = 3600
DAYS = 3
"""Days whose same hours are averaged."""
ANOMALY_HOURS = 12.0
"""Time in which what differs from those days now is expected to fade to a third."""

READ_SECONDS = 10.0
"""How long a plan waits for the forecast's file."""


def forecast_in_time(path: Path | None) -> tuple[tuple[Telemetry, ...], str]:
    """Return the members of the forecast in a file and an empty text, or none and one line that says why.

    A forecast makes a plan better; one that is late, broken or on a share that hangs does not cost the plan.
    """
    if path is None:
        return (), ""
    try:
        return HandOff("the forecast", patience=READ_SECONDS, share=1.0).do(lambda: read_forecast(path)), ""
    except LateError:
        problem = f"{path}: not read within {READ_SECONDS:g} s"
    except IgrowError as error:
        problem = str(error)
    except Exception as error:
        problem = f"{path}: cannot be read: {type(error).__name__}"
    return (), f"planned with the weather of the last days, as there is no forecast: {problem}"


def persistence(log: Telemetry, start: int, hours: int) -> Floats:
    """Return the weather expected from `start` (seconds since 1970 UTC), hourly means, (hours, 6).

    The mean of the same hour of the last `DAYS` days, plus the difference of the last hours from it, which fades
    with a time constant of `ANOMALY_HOURS`; radiation keeps the course of those days. A site without a sensor for
    outdoor CO2 or the sky gets 420 ppm and a clear-sky estimate (Swinbank 1963, Q. J. R. Meteorol. Soc. 89,
    339-348: 0.0552 T^1.5, T in K).
    Raises IgrowError where the log of the last day lacks a quantity that cannot be estimated.
    """
    table = hourly(log, start - DAYS * 24 * HOUR, DAYS * 24)
    days = table.reshape(DAYS, 24, len(NEEDED))
    known = np.isfinite(days)
    count = known.sum(axis=0)
    typical = np.where(count > 0, np.where(known, days, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
    typical = without_gaps(typical)
    recent = days[-1, -3:]
    anomaly = np.zeros(len(NEEDED))
    for column, name in enumerate(NEEDED):
        both = np.isfinite(recent[:, column])
        if both.any() and name != "global_radiation":
            anomaly[column] = float((recent[both, column] - typical[-3:, column][both]).mean())
    ahead = np.arange(hours)
    fading = np.exp(-(ahead + 1.0) / ANOMALY_HOURS)
    expected = typical[ahead % 24] + fading[:, None] * anomaly
    return np.asarray(np.clip(expected, LOWEST, HIGHEST))


def from_forecast(forecast: Telemetry, log: Telemetry, start: int, hours: int) -> Floats:
    """Return the weather of a forecast as hourly means, (hours, 6), with persistence where it has gaps.

    What no weather can be is a gap too, such as the -9999 of a model that knows nothing.
    """
    table = hourly(forecast, start, hours)
    known = (table >= LOWEST) & (table <= HIGHEST)
    if known.all():
        return table
    return np.where(known, table, persistence(log, start, hours))


def hourly(telemetry: Telemetry, start: int, hours: int, names: Sequence[str] = NEEDED) -> Floats:
    """Return hourly means from `start` on, (hours, names), NaN where nothing is known."""
    begin = np.datetime64(start, "s")
    selected = telemetry.select(begin, begin + np.timedelta64(hours * HOUR, "s"))
    result = np.full((hours, len(names)), np.nan)
    # The grid lies on whole hours; the plan may not, so it is moved there and back.
    shift = np.timedelta64(start % HOUR, "s")
    grid = to_grid(Telemetry(selected.time - shift, selected.columns), HOUR)
    rows = (grid.time - (begin - shift)).astype(np.int64) // HOUR
    for column, name in enumerate(names):
        if name in grid:
            result[rows, column] = grid[name]
    return result


def without_gaps(day: Floats) -> Floats:
    """Return the hourly weather of a day, (24, 6), with gaps bridged and what no sensor measures estimated.

    Raises IgrowError where nothing is known of a quantity that cannot be estimated.
    """
    whole = day.copy()
    for column, name in enumerate(NEEDED):
        if np.isnan(whole[:, column]).any():
            whole[:, column] = _fill(name, whole, column)
    return whole


def _fill(name: str, typical: Floats, column: int) -> Floats:
    """Return a course of the day without gaps, (24,); raises IgrowError where nothing is known."""
    values = typical[:, column]
    present = np.flatnonzero(np.isfinite(values))
    if len(present):
        return np.interp(np.arange(24), present, values[present], period=24)
    if name == "outdoor_co2":
        return np.full(24, 420.0)
    if name == "sky_temperature":
        outdoor = typical[:, NEEDED.index("outdoor_temperature")]
        return np.asarray(0.0552 * (outdoor + 273.15) ** 1.5 - 273.15)
    raise IgrowError(f"the log of the last days holds no {name}, so no weather can be expected")
