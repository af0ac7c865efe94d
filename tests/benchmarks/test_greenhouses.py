from __future__ import annotations

import dataclasses

import numpy as np

from benchmarks.diagnosis.greenhouses import others

SEED = 1


def test_greenhouses_elsewhere_are_other_greenhouses_each_time_the_same() -> None:
    greenhouses = others(4, SEED)
    assert list(greenhouses) == [greenhouse.site.name for greenhouse in greenhouses.values()]
    for first, second in zip(greenhouses.values(), others(4, SEED).values(), strict=True):
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


def test_the_weather_of_a_greenhouse_has_the_sun_of_its_latitude() -> None:
    start = np.datetime64("2020-12-01T00:00:00")
    end = start + np.timedelta64(7, "D")
    (greenhouse,) = others(1, SEED).values()
    north, south = (
        dataclasses.replace(greenhouse, site=dataclasses.replace(greenhouse.site, latitude=latitude)).weather(
            start, end, 1
        )
        for latitude in (58.0, 44.0)
    )
    assert south["global_radiation"].sum() > 2.0 * north["global_radiation"].sum()
