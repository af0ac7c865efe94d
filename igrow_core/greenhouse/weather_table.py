"""Weather as the plant reads it: on a regular grid, without gaps, between the rows by straight lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from igrow.core.air import co2_concentration, vapour_concentration
from igrow.core.arrays import Array
from igrow.core.errors import IgrowError
from igrow.core.greenhouse.sky import sky_temperature
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry

GRID = 300
"""Seconds between rows."""
REQUIRED = ("outdoor_temperature", "outdoor_humidity", "global_radiation", "wind_speed")
"""Columns without which there is no weather."""


class WeatherRow(NamedTuple):
    """The weather of one moment: units of the registry, and the contents of the air in kg m-3."""

    outdoor_temperature: Array
    outdoor_humidity: Array
    outdoor_co2: Array
    global_radiation: Array
    wind_speed: Array
    sky_temperature: Array
    wind_east: Array
    """Where the wind comes from, as the east and north parts of a unit vector."""
    wind_north: Array
    rain: Array
    vapour: Array
    co2: Array


class WeatherTable:
    """Rows of weather for one greenhouse, or one sequence for each greenhouse of a batch.

    Columns that are missing get a default: outdoor_co2 415 ppm, sky_temperature from air temperature and humidity
    under a sky half covered, wind from the south-west, no rain. Gaps are bridged by straight lines.

    Raises:
        IgrowError: for a required column that is absent or empty.
    """

    def __init__(self, weather: Telemetry | Sequence[Telemetry]) -> None:
        tables = [weather] if isinstance(weather, Telemetry) else list(weather)
        self.start = max(float(unix_seconds(table.time[0])) for table in tables)
        self.end = min(float(unix_seconds(table.time[-1])) for table in tables)
        if not self.end > self.start:
            raise IgrowError("weather: the tables have no common span of time; at least two rows are needed")
        count = int((self.end - self.start) // GRID) + 2
        seconds = self.start + GRID * np.arange(count, dtype=np.float64)
        columns = [_columns(table, seconds) for table in tables]
        self.rows: NDArray[np.float64]
        """Shape (rows, 11), or (rows, 11, N) for a sequence of tables."""
        self.rows = columns[0] if isinstance(weather, Telemetry) else np.stack(columns, axis=2)

    def at(self, seconds: float) -> WeatherRow:
        """Return the weather at seconds since 1970; raises IgrowError outside its span."""
        if not self.start <= seconds <= self.end:
            first, last, asked = (
                np.datetime_as_string(np.datetime64(int(value), "s")) + "Z" for value in (self.start, self.end, seconds)
            )
            raise IgrowError(f"weather: it reaches from {first} to {last}; {asked} is outside")
        position = (seconds - self.start) / GRID
        index = int(position)
        row = self.rows[index]
        row = row + (position - index) * (self.rows[index + 1] - row)
        return WeatherRow(*(row.tolist() if row.ndim == 1 else row))


def _columns(table: Telemetry, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    known = unix_seconds(table.time)

    def column(name: str, default: Any = None) -> NDArray[np.float64]:
        if name in table:
            values = table[name]
            present = ~np.isnan(values)
            if present.any():
                return np.interp(seconds, known[present], values[present])
        if default is None:
            raise IgrowError(f"weather: no values of {name}; needed are {', '.join(REQUIRED)}")
        return np.broadcast_to(np.asarray(default, dtype=np.float64), seconds.shape)

    temperature, humidity = column("outdoor_temperature"), column("outdoor_humidity")
    carbon = column("outdoor_co2", 415.0)
    direction = np.radians(column("wind_direction", 225.0))
    if "wind_direction" in table:
        angle = np.radians(table["wind_direction"])
        present = ~np.isnan(angle)
        if present.any():
            east = np.interp(seconds, known[present], np.sin(angle[present]))
            north = np.interp(seconds, known[present], np.cos(angle[present]))
            direction = np.arctan2(east, north)
    return np.stack(
        [
            temperature,
            humidity,
            carbon,
            np.maximum(column("global_radiation"), 0.0),
            np.maximum(column("wind_speed"), 0.0),
            column("sky_temperature", sky_temperature(temperature, humidity, 0.5)),
            np.sin(direction),
            np.cos(direction),
            column("rain", 0.0),
            vapour_concentration(np, temperature, humidity),
            co2_concentration(temperature, carbon),
        ],
        axis=1,
    )
