from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.diagnosis.greenhouses import neighbours, of_seasons, others


def test_greenhouses_elsewhere_are_other_greenhouses_each_time_the_same() -> None:
    greenhouses = others(4)
    assert list(greenhouses) == [greenhouse.site.name for greenhouse in greenhouses.values()]
    for first, second in zip(greenhouses.values(), others(4).values(), strict=True):
        assert dataclasses.astuple(first.plant) == dataclasses.astuple(second.plant)
        assert first.start == second.start
    assert len({greenhouse.plant.leakage for greenhouse in greenhouses.values()}) == 4
    assert len({greenhouse.seed for greenhouse in greenhouses.values()}) == 4
    assert [greenhouse.site.greenhouse.lamps is None for greenhouse in greenhouses.values()] == [
        False,
        True,
        False,
        True,
    ]


def test_neighbours_differ_under_one_sun_with_or_without_lamps() -> None:
    for place in others(2).values():
        some = neighbours(place, 3)
        assert (
            len({greenhouse.plant.leakage for greenhouse in some}) == len({greenhouse.seed for greenhouse in some}) == 3
        )
        for greenhouse in some:
            assert (greenhouse.start, greenhouse.site.latitude) == (place.start, place.site.latitude)
            assert (greenhouse.site.greenhouse.lamps is None) == (place.site.greenhouse.lamps is None)
            assert greenhouse.site.greenhouse.mean_height == np.mean(greenhouse.plant.air_height)


def test_the_seasons_share_one_greenhouse() -> None:
    winter, spring, autumn = of_seasons().values()
    assert winter.plant == spring.plant == autumn.plant
    assert len({winter.start, spring.start, autumn.start}) == 3


def test_the_weather_of_a_greenhouse_has_the_sun_of_its_latitude() -> None:
    start = np.datetime64("2020-12-01T00:00:00")
    end = start + np.timedelta64(7, "D")
    greenhouse = of_seasons()["winter"]
    north, south = (
        dataclasses.replace(greenhouse, site=dataclasses.replace(greenhouse.site, latitude=latitude)).weather(
            start, end, 1
        )
        for latitude in (58.0, 44.0)
    )
    assert south["global_radiation"].sum() > 2.0 * north["global_radiation"].sum()
