from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.diagnosis.houses import elsewhere, neighbours, of_seasons


def test_houses_elsewhere_are_other_greenhouses_each_time_the_same() -> None:
    houses = elsewhere(4)
    assert list(houses) == [house.site.name for house in houses.values()]
    for first, second in zip(houses.values(), elsewhere(4).values(), strict=True):
        assert dataclasses.astuple(first.plant) == dataclasses.astuple(second.plant)
        assert first.start == second.start
    assert len({house.plant.leakage for house in houses.values()}) == 4
    assert len({house.seed for house in houses.values()}) == 4
    assert [house.site.greenhouse.lamps is None for house in houses.values()] == [False, True, False, True]


def test_neighbours_differ_under_one_sun_with_or_without_lamps() -> None:
    for place in elsewhere(2).values():
        some = neighbours(place, 3)
        assert len({house.plant.leakage for house in some}) == len({house.seed for house in some}) == 3
        for house in some:
            assert (house.start, house.site.latitude) == (place.start, place.site.latitude)
            assert (house.site.greenhouse.lamps is None) == (place.site.greenhouse.lamps is None)
            assert house.site.greenhouse.mean_height == np.mean(house.plant.air_height)


def test_the_seasons_share_one_greenhouse() -> None:
    winter, spring, autumn = of_seasons().values()
    assert winter.plant == spring.plant == autumn.plant
    assert len({winter.start, spring.start, autumn.start}) == 3


def test_the_weather_of_a_house_has_the_sun_of_its_latitude() -> None:
    start = np.datetime64("2020-12-01T00:00:00")
    end = start + np.timedelta64(7, "D")
    house = of_seasons()["winter"]
    north, south = (
        dataclasses.replace(house, site=dataclasses.replace(house.site, latitude=latitude)).weather(start, end, 1)
        for latitude in (58.0, 44.0)
    )
    assert south["global_radiation"].sum() > 2.0 * north["global_radiation"].sum()
