"""The grower's rule-based recipe: what each setpoint is at which time of day."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from zoneinfo import ZoneInfo

from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.yaml_schema import SettingError, setting
from igrow.edge.image import Image
from igrow.edge.sensors.consequences import usable_for_control
from igrow.edge.sources.decision import Offer

DAYLIGHT = 20.0
"""Global radiation in W m-2 above which it is day, when the clock cannot tell."""


@dataclass(frozen=True)
class Period:
    """A value from a time of day on, until the next period's time."""

    at: datetime.time = setting(help="local time of day at which this value begins")
    value: float = setting(help="in the setpoint's unit")


def _periods(*rows: tuple[int, float]) -> tuple[Period, ...]:
    return tuple(Period(datetime.time(hour), value) for hour, value in rows)


@dataclass(frozen=True)
class Recipe:
    """Day and night by the clock, for each setpoint; an empty list leaves that setpoint to the safe value."""

    heating_setpoint: tuple[Period, ...] = setting(
        help="degC", default_factory=lambda: _periods((1, 18.5), (7, 20.5), (17, 19.0), (20, 17.0))
    )
    co2_setpoint: tuple[Period, ...] = setting(help="ppm", default_factory=lambda: _periods((1, 800.0), (17, 400.0)))
    lamp_on: tuple[Period, ...] = setting(help="0 to 1", default_factory=lambda: _periods((1, 1.0), (17, 0.0)))
    irrigation_on: tuple[Period, ...] = setting(help="0 to 1", default_factory=lambda: _periods((3, 1.0), (16, 0.0)))
    humidity_setpoint: tuple[Period, ...] = setting(help="%, of a PLC that takes one", default=())
    ventilation_setpoint: tuple[Period, ...] = setting(help="degC, of a PLC that takes one", default=())
    minimum_pipe_setpoint: tuple[Period, ...] = setting(help="degC, of a PLC that takes one", default=())
    energy_screen_setpoint: tuple[Period, ...] = setting(help="%, of a PLC that takes one", default=())
    lamps_off_above: float | None = setting(
        unit="W m-2", low=0, high=1500, default=300.0, help="global radiation above which the lamps stay off, or null"
    )

    def __post_init__(self) -> None:
        for name in SETPOINTS:
            periods = self.periods(name)
            for position, period in enumerate(periods):
                quantity = QUANTITIES[name]
                if not quantity.holds(period.value):
                    span = f"{quantity.low:g} to {quantity.high:g} {quantity.unit}"
                    raise SettingError(f"{name} is {period.value:g}: {span} makes sense", name, position, "value")
                if position and period.at <= periods[position - 1].at:
                    raise SettingError(f"the times of {name} must follow one another in the day", name, position, "at")

    def periods(self, name: str) -> tuple[Period, ...]:
        """Return the periods of one setpoint."""
        periods: tuple[Period, ...] = getattr(self, name)
        return periods


def recipe_at(recipe: Recipe, time_of_day: datetime.time, radiation: float | None) -> dict[str, float]:
    """Return the setpoints at a local time of day; `radiation` (W m-2) None switches no lamps off."""
    setpoints = {}
    for name in SETPOINTS:
        periods = recipe.periods(name)
        if not periods:
            continue
        # Before the first period of the day the last one of the day before still holds.
        value = periods[-1].value
        for period in periods:
            if period.at > time_of_day:
                break
            value = period.value
        setpoints[name] = value
    limit = recipe.lamps_off_above
    if "lamp_on" in setpoints and limit is not None and radiation is not None and radiation > limit:
        setpoints["lamp_on"] = 0.0
    return setpoints


def recipe_course(
    recipe: Recipe, zone: ZoneInfo, start: float, step_seconds: float, steps: int
) -> Mapping[str, tuple[float, ...]]:
    """Return the recipe over a horizon, by setpoint: (steps,); lamps as if they were never switched off by the sun."""
    rows = [
        recipe_at(recipe, datetime.datetime.fromtimestamp(start + k * step_seconds, zone).time(), None)
        for k in range(steps)
    ]
    return {name: tuple(row[name] for row in rows) for name in rows[0]} if rows else {}


class RecipeSource:
    """Offers the recipe. Without a trusted clock, daylight tells day (noon's values) from night (midnight's)."""

    name = "recipe"

    def __init__(self, recipe: Recipe, zone: ZoneInfo) -> None:
        self.recipe = recipe
        self._zone = zone

    def offer(self, image: Image) -> Offer:
        """Return the setpoints of this time of day."""
        radiation = usable_for_control(image.value_of("global_radiation"))
        if image.true_time is not None:
            local = datetime.datetime.fromtimestamp(image.true_time, self._zone)
            return Offer("the recipe", recipe_at(self.recipe, local.time(), radiation))
        if radiation is None:
            return Offer("no recipe without a clock or a radiation sensor")
        day = radiation > DAYLIGHT
        setpoints = recipe_at(self.recipe, datetime.time(12 if day else 0), radiation)
        # How long lamps may burn is a matter of the clock alone.
        setpoints.pop("lamp_on", None)
        return Offer(f"the recipe's {'day' if day else 'night'}, told by the light as the clock is wrong", setpoints)
