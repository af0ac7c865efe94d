"""What a separating test is: a small movement of the plant that tells causes apart which an ordinary log does not.

A step test, as system identification calls it (Ljung 1999, System Identification, chapter 13): the diagnosis names
effects that fit as well as each other, and a known course of a few openings or setpoints makes them differ. One
definition says what is moved, when it may begin and what ends it; gateway, trainer, page and benchmark
read it here. A test moves nothing by itself: the gateway's daemon asks its guard for the course, like any other source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

from igrow.core.quantities import with_unit

SOURCE = "separating_test"
"""The word for a test in the ledger, and the name of the quantity that marks its rows in the log."""


@dataclass(frozen=True)
class Condition:
    """A range that a measured quantity keeps while a test runs."""

    quantity: str
    low: float = -math.inf
    high: float = math.inf
    margin: float = 0.0
    """So far inside must it be for the test to begin."""
    if_measured: bool = False
    """A plant that does not measure it at all may be tested all the same."""

    def fault(self, value: float | None, *, beginning: bool) -> str:
        """Return an empty text, or in a line why a test may not begin, or not go on, at this value."""
        if value is None:
            return f"{self.quantity} cannot be believed"
        margin = self.margin if beginning else 0.0
        shown = with_unit(self.quantity, value, ".4g")
        if value < self.low + margin:
            return f"{self.quantity} is {shown}, below {with_unit(self.quantity, self.low + margin)}"
        if value > self.high - margin:
            return f"{self.quantity} is {shown}, above {with_unit(self.quantity, self.high - margin)}"
        return ""


@dataclass(frozen=True)
class Stage:
    """One part of a course: what stands for how long."""

    minutes: float
    values: Mapping[str, float]
    """By point, setpoints and openings of vents, in the quantity's unit."""


@dataclass(frozen=True)
class SeparatingTest:
    """One test."""

    name: str
    separates: tuple[str, ...]
    """Effects that it tells from others, by the catalogue's names."""
    title: str
    """What it is, for the grower: a noun phrase."""
    course: tuple[Stage, ...]
    """All stages move the same points."""
    when: Literal["night", "day"]
    """The whole of it lies between sunset and sunrise, or between sunrise and sunset."""
    conditions: tuple[Condition, ...]
    """Of the weather and the climate, beside the crop's own limits; see `climate_conditions`."""

    @property
    def points(self) -> tuple[str, ...]:
        """What it moves."""
        return tuple(self.course[0].values)

    @property
    def minutes(self) -> float:
        """How long it runs."""
        return sum(stage.minutes for stage in self.course)

    def at(self, minutes: float) -> Mapping[str, float] | None:
        """Return what stands so many minutes after the beginning, None once it is over."""
        ends = accumulate(stage.minutes for stage in self.course)
        return next((stage.values for stage, end in zip(self.course, ends, strict=True) if minutes < end), None)

    def span(self, point: str) -> tuple[float, float]:
        """Return the smallest and the largest value that it asks of a point."""
        values = [stage.values[point] for stage in self.course]
        return min(values), max(values)


def climate_conditions(temperature_low: float, temperature_high: float, humidity_high: float) -> tuple[Condition, ...]:
    """Return what every test keeps, whatever its own conditions: the climate within what harms the crop.

    Args:
        temperature_low: degC, of the site's crop.
        temperature_high: degC.
        humidity_high: %.
    """
    return (
        Condition("air_temperature", temperature_low, temperature_high, margin=1.5),
        Condition("air_humidity", high=humidity_high, margin=2.0),
    )
