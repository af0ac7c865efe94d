"""The guard keeps the crop's limits at the plant, whoever leads; the grower's own override passes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from igrow.core.agronomy import Place
from igrow.core.agronomy.inspection import violations
from igrow.core.site import Band, Site
from igrow.edge.guard import GuardRules, GuardState, PointRule, Request, guard
from igrow.edge.image import Image, Quality, Value

SITE = Site("crop", 52.0, 4.5, "Europe/Amsterdam")
PLACE = Place.of(SITE)
RULES = GuardRules(
    {
        "heating_setpoint": PointRule(low=10.0, high=30.0, safe=18.0, dead_band=0.1, minimum_interval=300.0),
        "co2_setpoint": PointRule(low=300.0, high=9000.0, safe=400.0),
        "lamp_on": PointRule(low=0.0, high=1.0, safe=0.0),
    },
    crop=PLACE,
)
MIDNIGHT = 1_580_598_000.0
"""2 February 2020, 00:00 in Amsterdam."""
MINUTES = 5


class Days:
    """Runs the guard for days on a plant that takes what is written."""

    def __init__(self, rules: GuardRules = RULES) -> None:
        self.rules, self.state = rules, GuardState()
        self.shown: dict[str, float | None] = {"heating_setpoint": 18.0, "co2_setpoint": 400.0, "lamp_on": 0.0}
        self.rows: list[dict[str, float]] = []
        self.kinds: set[tuple[str, str]] = set()

    def cycle(self, second: float, asked: Mapping[str, float], source: str = "recipe", clock: bool = True) -> None:
        image = Image(second, MIDNIGHT + second if clock else None, {"global_radiation": Value(0.0, Quality.GOOD, 0.0)})
        requests = {name: Request(value, source) for name, value in asked.items()}
        verdict = guard(requests, self.shown, {}, image, self.state, self.rules)
        self.state = verdict.state
        for write in verdict.writes:
            self.shown[write.point] = write.value
        self.kinds |= {(clamp.point, clamp.reason) for clamp in verdict.clamps if clamp.kind == "crop"}
        self.rows.append({name: float(value or 0.0) for name, value in self.shown.items()})


@pytest.mark.parametrize(
    "asked",
    [
        {"heating_setpoint": 28.0, "co2_setpoint": 8000.0, "lamp_on": 1.0},
        {"heating_setpoint": 11.0, "co2_setpoint": 800.0, "lamp_on": 1.0},
    ],
)
def test_days_under_a_wild_recipe_leave_no_limit(asked: Mapping[str, float]) -> None:
    days = Days()
    for step in range(3 * 24 * 60 // MINUTES):
        wild = dict(asked)
        if step % 40 < 10:
            wild["heating_setpoint"] = 40.0 - wild["heating_setpoint"]
        days.cycle(60.0 * MINUTES * step, wild)
    columns = {name: np.array([row[name] for row in days.rows]) for name in days.shown}
    # Within the dead band nothing is written: bounds and drift hold to that.
    crop = SITE.crop.agronomy
    calm = replace(
        crop, day_temperature=Band(16.9, 24.1), night_temperature=Band(14.9, 20.1), mean_temperature=Band(16.9, 22.1)
    )
    left = violations(
        replace(PLACE, limits=calm, drift=PLACE.drift + 0.1 * 60 / MINUTES),
        MIDNIGHT,
        columns["heating_setpoint"],
        columns["lamp_on"],
        columns["co2_setpoint"],
        np.zeros(len(days.rows)),
        60.0 * MINUTES,
    )
    assert left == []
    hourly = columns["heating_setpoint"].reshape(-1, 60 // MINUTES).mean(axis=1)
    assert np.abs(np.diff(hourly)).max() <= PLACE.drift + 0.2
    assert columns["lamp_on"].mean() > 0.6
    assert ("lamp_on", "the crop's dark_hours") in days.kinds


def test_the_growers_override_passes() -> None:
    days = Days()
    for step in range(24 * 12):
        days.cycle(300.0 * step, {"lamp_on": 1.0}, source="override")
    assert min(row["lamp_on"] for row in days.rows) == 1.0
    assert not days.kinds


def test_lamps_stay_dark_while_nobody_knows_the_hour() -> None:
    days = Days()
    days.cycle(0.0, {"lamp_on": 1.0}, clock=False)
    assert days.shown["lamp_on"] == 0.0
    assert "nobody knows how long the night still is" in next(iter(days.kinds))[1]


def test_a_clock_that_is_lost_is_carried_on() -> None:
    """Lamps that a plan asks for at noon burn, also when the clock was lost in the morning."""
    days = Days()
    for step in range(18 * 12):
        days.cycle(300.0 * step, {"lamp_on": 1.0 if step > 8 * 12 else 0.0}, clock=step < 9 * 12)
    assert days.shown["lamp_on"] == 1.0


def test_an_unknown_lamp_counts_as_lit() -> None:
    days = Days()
    days.shown["lamp_on"] = None
    for step in range(12):
        days.cycle(300.0 * step, {"heating_setpoint": 18.0})
        days.shown["lamp_on"] = None
    assert float(days.state.crop.had.darkest) == 0.0


def test_a_site_without_limits_of_a_crop_is_led_as_before() -> None:
    days = Days(GuardRules(RULES.points))
    for step in range(24 * 12):
        days.cycle(300.0 * step, {"lamp_on": 1.0, "heating_setpoint": 28.0})
    assert days.shown == {"heating_setpoint": 28.0, "co2_setpoint": 400.0, "lamp_on": 1.0}
