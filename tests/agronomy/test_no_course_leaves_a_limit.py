"""Whatever is asked for, at whatever place, under whatever limits: what is held leaves none of them."""

from __future__ import annotations

from dataclasses import replace
from datetime import time, timedelta

import numpy as np
import pytest

from igrow.core.agronomy import Memory, Place, remember
from igrow.core.agronomy.inspection import violations
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Agronomy, Band, Rest, Site
from igrow.core.telemetry import Telemetry
from tests.setpoint_tables import OPTIONAL

UNKNOWN = np.full(len(SETPOINTS), np.nan)
ZONES = ("Europe/Amsterdam", "UTC", "Asia/Kolkata", "America/New_York", "Australia/Adelaide", "Asia/Kathmandu")


def some_site(rng: np.random.Generator) -> Site:
    """Return a site anywhere, whose crop has any limits that make sense."""
    site = Site(
        "any",
        float(rng.uniform(-75, 75)),
        float(rng.uniform(-180, 180)),
        ZONES[int(rng.integers(len(ZONES)))],
        setpoints=SETPOINTS,
    )
    night_low, day_low = rng.uniform(12, 17), rng.uniform(13, 18)
    night_high, day_high = rng.uniform(19, 22), rng.uniform(19, 26)
    mean_low = rng.uniform(max(13, max(night_low, day_low) - 2), 18)
    crop = Agronomy(
        dark_hours=float(rng.choice([0.0, 4.0, 6.0, 8.5, 12.0])),
        day_temperature=Band(day_low, day_high),
        night_temperature=Band(night_low, night_high),
        mean_temperature=Band(mean_low, mean_low + rng.uniform(1.2, 6)),
        temperature_difference=float(rng.uniform(1, 10)),
        temperature_drift=float(rng.uniform(0.4, 4)),
        light_sum_high=float(rng.uniform(4, 40)),
        co2_with_people=float(rng.uniform(450, 1200)),
        people_from=time(int(rng.integers(24)), 30),
        people_until=time(int(rng.integers(24)), 15),
        dead_zone=float(rng.uniform(0, 3)),
        rest={"lamp_on": Rest(timedelta(hours=float(rng.uniform(0, 4))), timedelta(hours=float(rng.uniform(0, 4))))},
    )
    return replace(site, crop=replace(site.crop, agronomy=crop))


def some_wish(rng: np.random.Generator, hours: int, count: int = 4) -> np.ndarray:
    """Return wild setpoints (count, hours, S)."""
    block = int(rng.integers(1, 7))
    coarse = rng.random((count, -(-hours // block), len(SETPOINTS)))
    wish = np.repeat(coarse, block, axis=1)[:, :hours]
    wish[..., 0] = 10 + 20 * wish[..., 0]
    wish[..., 1] = 300 + 1200 * wish[..., 1]
    wish[..., 2] = (wish[..., 2] > rng.random()) * 1.0
    wish[..., SETPOINTS.index("ventilation_setpoint")] *= 40.0
    return wish


def left(site: Site, start: np.datetime64, course: np.ndarray, radiation: np.ndarray) -> list[str]:
    place = Place.of(site)
    heating, co2, lamp = (course[:, SETPOINTS.index(name)] for name in ("heating_setpoint", "co2_setpoint", "lamp_on"))
    vents = course[:, SETPOINTS.index("ventilation_setpoint")] if "ventilation_setpoint" in site.setpoints else None
    seconds = float(start.astype("datetime64[s]").astype(np.int64))
    return violations(place, seconds, heating, lamp, co2, place.sunlight(1.0) * radiation, ventilation=vents)


@pytest.mark.parametrize("seed", range(60))
def test_a_wild_wish_leaves_no_limit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    site = some_site(rng)
    start = np.datetime64("2020-01-01T00:00:00") + np.timedelta64(int(rng.integers(366 * 24)), "h")
    hours = 96
    hour = np.arange(hours)
    radiation = np.maximum(np.sin((hour % 24 - 6) / 12 * np.pi), 0.0) * rng.uniform(0, 900)
    template = for_site(site, start, hours, radiation=radiation)
    course = template.limit(some_wish(rng, hours), UNKNOWN)
    for one in course:
        assert not left(site, start, one, radiation), left(site, start, one, radiation)


def test_what_leaves_no_limit_passes_unchanged() -> None:
    site = Site("calm", 52.0, 4.5, "Europe/Amsterdam")
    start, hours = np.datetime64("2020-01-31T23:00:00"), 48
    hour = np.arange(hours) % 24
    day = (hour >= 9) & (hour < 16)
    wish = np.column_stack(
        [np.where(day, 19.5, 18.0), np.full(hours, 800.0), 1.0 * (hour < 16), 0.5 + 0.0 * hour]
        + [np.full(hours, value) for value in OPTIONAL]
    )
    template = for_site(site, start, hours)
    assert left(site, start, wish, np.zeros(hours)) == []
    evening = Memory(night=template.moments[0].night, dark=6.0, darkest=6.0)
    np.testing.assert_array_equal(template.limit(wish[None], UNKNOWN, evening)[0], wish)


@pytest.mark.parametrize(
    ("column", "value", "limit"),
    [
        (SETPOINTS.index("ventilation_setpoint"), 19.0, "dead_zone"),
        (0, 10.0, "night_temperature"),
        (0, 28.0, "day_temperature"),
        (2, 1.0, "dark_hours"),
        (1, 1000.0, "co2_with_people"),
    ],
)
def test_the_limit_that_binds_is_named(column: int, value: float, limit: str) -> None:
    site = Site("named", 52.0, 4.5, "Europe/Amsterdam", setpoints=SETPOINTS)
    site = replace(site, crop=replace(site.crop, agronomy=replace(site.crop.agronomy, co2_with_people=700.0)))
    start, hours = np.datetime64("2020-01-31T23:00:00"), 48
    wish = np.tile([18.5, 600.0, 0.0, 0.5, *OPTIONAL], (1, hours, 1))
    wish[..., SETPOINTS.index("ventilation_setpoint")] = 30.0
    wish[..., column] = value
    course = for_site(site, start, hours).follow(wish, UNKNOWN)
    named = {name for one in course.binding() for name in one.get(SETPOINTS[column], ())}
    assert limit in named
    assert not any(set(one) - {SETPOINTS[column]} for one in course.binding())


def test_vents_of_a_site_that_takes_no_ventilation_setpoint_bind_nothing() -> None:
    site, start, hours = Site("own", 52.0, 4.5, "Europe/Amsterdam"), np.datetime64("2020-01-31T23:00:00"), 48
    wish = np.tile([18.5, 600.0, 0.0, 0.5, *OPTIONAL], (1, hours, 1))
    wish[..., SETPOINTS.index("ventilation_setpoint")] = 15.0
    course = for_site(site, start, hours).follow(wish, UNKNOWN)
    np.testing.assert_array_equal(course.setpoints, wish)
    assert not any(course.binding())


def test_the_inspection_sees_each_limit_that_is_left() -> None:
    site = Site("seen", 52.0, 4.5, "Europe/Amsterdam", setpoints=SETPOINTS)
    start, hours = np.datetime64("2020-01-31T23:00:00"), 72
    good = np.tile([18.5, 600.0, 0.0, 0.5, *OPTIONAL], (hours, 1))
    dark = np.zeros(hours)
    assert left(site, start, good, dark) == []

    def found(column: int, values: np.ndarray, radiation: np.ndarray = dark) -> str:
        course = good.copy()
        course[:, column] = values
        return "; ".join(left(site, start, course, radiation))

    hour = np.arange(hours)
    assert "degC by night" in found(0, np.full(hours, 21.0))
    assert "degC by day" in found(0, np.full(hours, 16.0))
    assert "a mean of" in found(0, np.full(hours, 16.0))
    assert "K at once" in found(0, np.where(hour == 30, 22.0, 18.5))
    assert "between highest and lowest" in found(0, np.where(hour % 24 == 12, 24.0, 15.0))
    assert "are needed" in found(2, np.ones(hours))
    assert "from lamps" in found(2, 1.0 * (hour % 24 < 12), np.full(hours, 800.0))
    assert "ppm with people" in found(1, np.full(hours, 6000.0))
    assert "vents open at" in found(SETPOINTS.index("ventilation_setpoint"), np.full(hours, 19.0))


def test_history_counts_dark_hours_that_were_given() -> None:
    """Lamps may burn until sunrise only where the night has had its dark hours before."""
    site = Site("past", 52.0, 4.5, "Europe/Amsterdam")
    start = np.datetime64("2020-02-01T00:00:00")
    times = start - np.arange(12, 0, -1) * np.timedelta64(1, "h")
    wish = np.tile([18.5, 600.0, 1.0, 0.5, *OPTIONAL], (1, 24, 1))
    lamps = {}
    for name, lit in (("dark", 0.0), ("lit", 1.0)):
        columns = {"lamp_on": np.full(12, lit), "heating_setpoint": np.full(12, 18.5)}
        log = Telemetry(times.astype("datetime64[s]"), columns)
        memory = remember(Place.of(site), log, float(start.astype("datetime64[s]").astype(np.int64)))
        course = for_site(site, start, 24).follow(wish, UNKNOWN, memory).setpoints[0, :, 2]
        lamps[name] = course[:4]
    assert lamps["dark"].all()
    assert lamps["lit"][0] == 1.0 and not lamps["lit"][1:].any()
    without = for_site(site, start, 24).follow(wish, UNKNOWN, Memory()).setpoints[0, :4, 2]
    np.testing.assert_array_equal(without, lamps["lit"])
