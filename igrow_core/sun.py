"""Where the sun stands: elevation and azimuth from time and place.

Spencer's Fourier series (J. W. Spencer, 1971, Fourier series representation of the position of the sun,
Search 2, 172) for declination and equation of time; errors below 0.1 degree and 1 minute, which is far
less than a greenhouse can tell. Times are UTC, angles degrees.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from igrow.core.arrays import Array

SECONDS_PER_DAY = 86_400.0
SOLAR_CONSTANT = 1361.0
"""Radiation outside the atmosphere at the mean distance of the sun, W m-2 (Kopp and Lean, 2011)."""


def unix_seconds(time: ArrayLike | np.datetime64) -> NDArray[np.float64]:
    """Return seconds since 1970 UTC, float64, of datetime64 or of what numpy reads as such (same shape)."""
    seconds: NDArray[np.float64] = np.asarray(time, dtype="datetime64[s]").astype(np.int64).astype(np.float64)
    return seconds


def _year_angle(seconds: Array) -> Array:
    """Return the angle of the year in radians; the year is taken as 365.2425 days since 2000."""
    return (seconds - 946_684_800.0) * (2.0 * math.pi / (365.2425 * SECONDS_PER_DAY))


def declination_and_equation(xp: Any, seconds: Array) -> tuple[Array, Array]:
    """Return declination (rad) and equation of time (s) at seconds since 1970 (Spencer 1971)."""
    angle = _year_angle(seconds)
    c1, s1 = xp.cos(angle), xp.sin(angle)
    c2, s2 = c1 * c1 - s1 * s1, 2.0 * s1 * c1
    c3, s3 = c1 * c2 - s1 * s2, s1 * c2 + c1 * s2
    declination = (
        0.006918 - 0.399912 * c1 + 0.070257 * s1 - 0.006758 * c2 + 0.000907 * s2 - 0.002697 * c3 + 0.00148 * s3
    )
    equation = 13_750.99 * (0.000075 + 0.001868 * c1 - 0.032077 * s1 - 0.014615 * c2 - 0.040849 * s2)
    return declination, equation


def position(xp: Any, seconds: Array, latitude: float, longitude: float) -> tuple[Array, Array, Array]:
    """Return (elevation deg, azimuth deg clockwise from north, local solar hour 0 to 24).

    `seconds` since 1970 UTC, elementwise; `latitude` north and `longitude` east in degrees. Refraction is left
    out: it matters only below 1 degree, where there is no radiation to speak of.
    """
    declination, equation = declination_and_equation(xp, seconds)
    solar = seconds + 240.0 * longitude + equation
    day_fraction = solar / SECONDS_PER_DAY
    hour = 24.0 * (day_fraction - xp.floor(day_fraction))
    hour_angle = (hour - 12.0) * (math.pi / 12.0)
    sin_latitude, cos_latitude = math.sin(math.radians(latitude)), math.cos(math.radians(latitude))
    sin_declination, cos_declination = xp.sin(declination), xp.cos(declination)
    east = -cos_declination * xp.sin(hour_angle)
    north = cos_latitude * sin_declination - sin_latitude * cos_declination * xp.cos(hour_angle)
    up = sin_latitude * sin_declination + cos_latitude * cos_declination * xp.cos(hour_angle)
    arctan2 = math.atan2 if isinstance(up, float) else np.arctan2
    elevation = arctan2(up, xp.sqrt(east * east + north * north)) * (180.0 / math.pi)
    azimuth = arctan2(east, north) * (180.0 / math.pi)
    return elevation, azimuth - 360.0 * xp.floor(azimuth / 360.0), hour


def elevation(time: ArrayLike | np.datetime64, latitude: float, longitude: float) -> NDArray[np.float64]:
    """Return the sun's elevation above the horizon in degrees; `time` UTC, any shape; the same shape back."""
    return np.asarray(position(np, unix_seconds(time), latitude, longitude)[0])


def azimuth(time: ArrayLike | np.datetime64, latitude: float, longitude: float) -> NDArray[np.float64]:
    """Return the sun's azimuth in degrees clockwise from north, 0 to 360; `time` UTC, any shape."""
    return np.asarray(position(np, unix_seconds(time), latitude, longitude)[1])


def solar_hour(time: ArrayLike | np.datetime64, latitude: float, longitude: float) -> NDArray[np.float64]:
    """Return local solar time in hours, 0 to 24; 12 is when the sun is highest."""
    return np.asarray(position(np, unix_seconds(time), latitude, longitude)[2])


def solar_day(time: ArrayLike | np.datetime64, longitude: float) -> NDArray[np.int64]:
    """Return the number of the local mean solar day, counted from 1970; `time` UTC, any shape; the same shape back."""
    day: NDArray[np.int64] = np.floor((unix_seconds(time) + 240.0 * longitude) / SECONDS_PER_DAY).astype(np.int64)
    return day


def weekday(day: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the weekday of a day counted from 1970, 0 for Monday (1 January 1970 was a Thursday)."""
    return (day + 3) % 7


def extraterrestrial_radiation(
    time: ArrayLike | np.datetime64, latitude: float, longitude: float
) -> NDArray[np.float64]:
    """Return the radiation on a horizontal plane outside the atmosphere, W m-2 (never negative).

    The distance of the sun is a first-order cosine: 1 + 0.033 cos(2 pi day / 365) (Duffie and Beckman 2013, eq.
    1.4.1a).
    """
    seconds = unix_seconds(time)
    height = np.sin(np.radians(position(np, seconds, latitude, longitude)[0]))
    distance = 1.0 + 0.033 * np.cos(_year_angle(seconds))
    return np.asarray(SOLAR_CONSTANT * distance * np.maximum(height, 0.0))
