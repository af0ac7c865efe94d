"""The sun's position, and weather that a seed repeats."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.greenhouse import generate_weather
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.quantities import QUANTITIES, WEATHER
from igrow.core.sun import azimuth, elevation, extraterrestrial_radiation, solar_hour
from tests.greenhouse.greenhouse_seasons import hours

YEAR = np.datetime64("2019-07-01T00:00:00", "s")


def test_the_sun_of_solstices_and_equinox() -> None:
    # At local noon the elevation is 90 - latitude + declination.
    for day, height in (("2020-06-20", 90.0 - 52.0 + 23.44), ("2020-12-21", 90.0 - 52.0 - 23.44), ("2020-03-20", 38.0)):
        times = np.datetime64(f"{day}T00:00:00", "s") + np.arange(0, 86_400, 60) * np.timedelta64(1, "s")
        heights = elevation(times, 52.0, 4.5)
        assert heights.max() == pytest.approx(height, abs=0.3)
        noon = times[heights.argmax()]
        assert azimuth(noon, 52.0, 4.5) == pytest.approx(180.0, abs=0.6)
        assert solar_hour(noon, 52.0, 4.5) == pytest.approx(12.0, abs=0.03)


def test_the_sun_rises_in_the_east() -> None:
    morning = np.datetime64("2020-03-20T06:00:00", "s")
    assert 80.0 < azimuth(morning, 52.0, 4.5) < 110.0
    assert extraterrestrial_radiation(np.datetime64("2020-03-20T00:00:00"), 52.0, 4.5) == 0.0


def test_a_year_of_weather_is_that_of_the_place() -> None:
    weather = generate_weather(YEAR, YEAR + hours(24 * 365), seed=1)
    assert set(weather.columns) == set(WEATHER)
    for name, values in weather.columns.items():
        assert np.all((values >= QUANTITIES[name].low) & (values <= QUANTITIES[name].high)), name
    assert 9.0 < weather["outdoor_temperature"].mean() < 12.5
    # The Dutch coast has some 3.6 GJ of sun a year, 5 m/s of wind and rain in 7 % of the time.
    assert 3.0 < weather["global_radiation"].sum() * 300 / 1e9 < 4.3
    assert 4.0 < weather["wind_speed"].mean() < 5.8
    assert 0.03 < weather["rain"].mean() < 0.12
    month = weather.time.astype("datetime64[M]").astype(int) % 12
    warm, cold = (weather["outdoor_temperature"][month == number].mean() for number in (6, 0))
    assert 11.0 < warm - cold < 18.0


def test_clear_nights_have_a_cold_sky_and_dark_nights_no_sun() -> None:
    weather = generate_weather(YEAR, YEAR + hours(24 * 30), seed=2)
    night = elevation(weather.time, 52.0, 4.5) < -1.0
    assert np.all(weather["global_radiation"][night] == 0.0)
    depression = weather["outdoor_temperature"] - weather["sky_temperature"]
    assert depression.min() > -1.0
    assert depression.max() > 12.0


def test_a_seed_repeats_its_weather_whatever_the_end() -> None:
    short = generate_weather(YEAR, YEAR + hours(48), seed=3)
    long = generate_weather(YEAR, YEAR + hours(96), seed=3)
    other = generate_weather(YEAR, YEAR + hours(48), seed=4)
    for name in WEATHER:
        np.testing.assert_allclose(short[name], long[name][: len(short)], rtol=1e-9, atol=1e-9)
    assert not np.allclose(short["outdoor_temperature"], other["outdoor_temperature"])


def test_the_southern_summer_is_in_january() -> None:
    place = WeatherClimate(latitude=-38.0, longitude=145.0)
    january = generate_weather(
        np.datetime64("2020-01-01T00:00:00"), np.datetime64("2020-01-20T00:00:00"), seed=1, climate=place
    )
    july = generate_weather(
        np.datetime64("2020-07-01T00:00:00"), np.datetime64("2020-07-20T00:00:00"), seed=1, climate=place
    )
    assert january["outdoor_temperature"].mean() > july["outdoor_temperature"].mean() + 8.0
    assert january["global_radiation"].mean() > 1.8 * july["global_radiation"].mean()


def test_an_end_before_the_start_is_refused() -> None:
    with pytest.raises(IgrowError, match="must lie after"):
        generate_weather(YEAR, YEAR - hours(1), seed=1)
