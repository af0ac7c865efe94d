from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.diagnosis.houses import elsewhere, of_seasons
from igrow_core.sun import elevation


def test_houses_elsewhere_are_other_greenhouses_each_time_the_same() -> None:
    houses = elsewhere(4)
    assert list(houses) == [house.site.name for house in houses.values()]
    for first, second in zip(houses.values(), elsewhere(4).values(), strict=True):
        assert dataclasses.astuple(first.plant) == dataclasses.astuple(second.plant)
        assert first.start == second.start
    assert len({house.plant.leakage for house in houses.values()}) == 4
    assert len({house.seed for house in houses.values()}) == 4
    assert [house.site.greenhouse.lamps is None for house in houses.values()] == [False, True, False, True]


def test_the_seasons_share_one_greenhouse() -> None:
    winter, spring, autumn = of_seasons().values()
    assert winter.plant == spring.plant == autumn.plant
    assert len({winter.start, spring.start, autumn.start}) == 3


def test_the_sun_of_a_house_s_weather_stands_over_that_house() -> None:
    for house in elsewhere(4).values():
        weather = house.weather(house.start, house.start + np.timedelta64(2, "D"), house.seed)
        height = elevation(weather.time, house.site.latitude, house.site.longitude)
        lit = weather["global_radiation"] > 5.0
        assert lit.any()
        assert np.all(height[lit] > 0.0)
        assert np.corrcoef(np.sin(np.radians(np.maximum(height, 0.0))), weather["global_radiation"])[0, 1] > 0.8
