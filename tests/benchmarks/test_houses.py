from __future__ import annotations

import dataclasses

from benchmarks.diagnosis.houses import elsewhere, of_seasons


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
