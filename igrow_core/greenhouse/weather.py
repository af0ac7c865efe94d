"""A seeded weather generator: seasons, days, clouds, fronts, wind and rain for a given place.

It makes no claim on a climate's fine statistics; it gives the plant weather with the right size, daily and yearly
course, and correlations (clear nights are cold and have a cold sky, rain needs clouds, fronts bring both).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.errors import IgrowError
from igrow.core.greenhouse.sky import sky_temperature
from igrow.core.quantities import WEATHER
from igrow.core.sun import elevation, solar_hour, unix_seconds
from igrow.core.telemetry import Telemetry, to_grid

STEP = 300
"""Seconds between rows."""


@dataclass(frozen=True)
class WeatherClimate:
    """The climate of a place; the defaults are those of the Dutch coast."""

    latitude: float = 52.0
    longitude: float = 4.5
    mean_temperature: float = 10.8
    """Of the year, degC."""
    seasonal_amplitude: float = 7.2
    """Half the difference between warmest and coldest month, K."""
    synoptic_deviation: float = 3.0
    """Standard deviation of the daily mean about its season, K."""
    diurnal_amplitude: float = 4.6
    """Half the daily range under a clear sky in summer, K."""
    mean_cloud: float = 0.66
    """Mean cloud cover, 0 to 1."""
    mean_wind: float = 4.8
    """m s-1."""
    outdoor_co2: float = 415.0
    """ppm."""


def autoregressive(rng: np.random.Generator, count: int, correlation_seconds: float) -> NDArray[np.float64]:
    """Return a stationary AR(1) series of unit variance, shape (count,), with the given correlation time."""
    keep = float(np.exp(-STEP / correlation_seconds))
    drawn = rng.standard_normal(count)
    drawn[1:] *= np.sqrt(1.0 - keep * keep)
    # Blocks turn the recursion into products of whole arrays; 256 steps keep the powers within range.
    series = np.empty(count)
    block = 256
    powers = keep ** np.arange(1, block + 1)
    last = 0.0
    lower = np.tril(keep ** np.maximum(np.subtract.outer(np.arange(block), np.arange(block)), 0))
    for first in range(0, count, block):
        part = drawn[first : first + block]
        size = len(part)
        series[first : first + size] = lower[:size, :size] @ part + powers[:size] * last
        last = series[first + size - 1]
    return series


def clear_sky_radiation(sun_elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the global radiation under a clear sky, W m-2: 910 sin h - 30 (Kasten and Czeplak 1980, eq. 1)."""
    return np.maximum(910.0 * np.sin(np.radians(sun_elevation)) - 30.0, 0.0)


def generate_weather(
    start: np.datetime64, end: np.datetime64, *, seed: int, climate: WeatherClimate | None = None
) -> Telemetry:
    """Return weather from `start` to `end` (both included, UTC) every 5 minutes: all eight weather quantities.

    The same seed, start and climate give the same weather; another end only its beginning or more of it.

    Clouds reduce the clear sky's radiation by 1 - 0.75 C^3.4 (Kasten and Czeplak 1980, Solar Energy 24, 177-189);
    the sky's temperature is that of `sky.sky_temperature`; the rest is autoregressive (fronts 60 h, clouds 5 h,
    showers 25 min, wind 7 h and gusts 15 min).

    Raises:
        IgrowError: where `end` does not lie after `start`.
    """
    if not end > start:
        raise IgrowError(f"weather: the end {end} must lie after the start {start}")
    place = climate or WeatherClimate()
    count = int((unix_seconds(end) - unix_seconds(start)) // STEP) + 1
    time = start.astype("datetime64[s]") + np.arange(count) * np.timedelta64(STEP, "s")
    # One generator for each process: a longer series then begins like a shorter one.
    streams = [np.random.default_rng([seed, number]) for number in range(10)]

    def noise(number: int, hours: float) -> NDArray[np.float64]:
        return autoregressive(streams[number], count, 3600.0 * hours)

    height = elevation(time, place.latitude, place.longitude)
    hour = solar_hour(time, place.latitude, place.longitude)
    day_of_year = (unix_seconds(time) / 86_400.0) % 365.2425
    # The year's course lags the sun by a month; south of the equator it is turned round.
    season = np.cos(2.0 * np.pi * (day_of_year - 202.0) / 365.2425) * (1.0 if place.latitude >= 0.0 else -1.0)

    front = noise(0, 60.0)
    cloud_state = 0.75 * front + 0.66 * noise(1, 5.0)
    cloud = 1.0 / (1.0 + np.exp(-(np.log(place.mean_cloud / (1.0 - place.mean_cloud)) * 1.5 + 2.2 * cloud_state)))
    # Broken clouds let the sun through by turns, most when half the sky is covered.
    flicker = 1.0 + 1.1 * cloud * (1.0 - cloud) * noise(2, 0.3)
    radiation = clear_sky_radiation(height) * (1.0 - 0.75 * cloud**3.4) * np.clip(flicker, 0.3, 1.25)

    mild = np.where(season < 0.0, 1.0, -0.6) * front * 0.4
    air_mass = noise(3, 80.0)
    clear = 1.0 - 0.75 * cloud
    diurnal = place.diurnal_amplitude * (0.75 + 0.35 * season) * clear * np.cos(2.0 * np.pi * (hour - 15.0) / 24.0)
    daily_mean = (
        place.mean_temperature + place.seasonal_amplitude * season + place.synoptic_deviation * (0.9 * air_mass + mild)
    )
    temperature = daily_mean + diurnal + 0.25 * noise(4, 1.0)
    dew_point = daily_mean - 2.0 - 2.2 * clear + 1.2 * noise(5, 20.0)
    humidity = np.clip(100.0 * _saturation_ratio(np.minimum(dew_point, temperature), temperature), 20.0, 99.5)

    strength = 0.55 * front + 0.83 * noise(6, 7.0)
    gusts = noise(7, 0.25)
    day_wind = 1.0 + 0.18 * np.cos(2.0 * np.pi * (hour - 14.0) / 24.0)
    wind = place.mean_wind * day_wind * (0.62 + 0.30 * np.maximum(strength + 1.6, 0.0) ** 1.6 * 0.55)
    wind = np.maximum(wind * (1.0 + 0.16 * gusts), 0.0)
    direction = (225.0 + 55.0 * noise(8, 30.0) + 12.0 * gusts) % 360.0

    shower = noise(9, 0.4) + 1.4 * (front - 0.9)
    rain = ((cloud > 0.8) & (shower > 0.75)).astype(np.float64)
    return Telemetry(
        time,
        {
            "outdoor_temperature": temperature,
            "outdoor_humidity": np.where(rain > 0.0, np.maximum(humidity, 88.0), humidity),
            "outdoor_co2": place.outdoor_co2 + 8.0 * np.clip(-height, -30.0, 30.0) / 30.0 + 4.0 * air_mass,
            "global_radiation": radiation,
            "wind_speed": wind,
            "sky_temperature": sky_temperature(temperature, humidity, cloud),
            "wind_direction": direction,
            "rain": rain,
        },
    )


def _saturation_ratio(dew_point: NDArray[np.float64], temperature: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vapour pressure at the dew point over that of saturation at the temperature (Magnus form)."""
    return np.asarray(np.exp(17.625 * dew_point / (dew_point + 243.04) - 17.625 * temperature / (temperature + 243.04)))


def hourly_weather(weather: Telemetry, start: np.datetime64, hours: int) -> NDArray[np.float64]:
    """Return hourly means from `start` on in the registry's order, (H, 6); `start` is a whole hour."""
    table = to_grid(weather.select(start, start + np.timedelta64(hours, "h")), 3600)
    return np.stack([table[name] for name in WEATHER[:6]], axis=1)
