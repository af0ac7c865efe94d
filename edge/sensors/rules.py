"""How fast each sensor can move, how long it can stand still, and how long an old value means something."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from igrow.core.quantities import QUANTITIES, Kind
from igrow.edge.registers.model import TWIN_SUFFIX

INFINITE = float("inf")


@dataclass(frozen=True, slots=True)
class SensorRule:
    """What a working sensor at one point does."""

    low: float
    high: float
    """Range of a working sensor, in the point's unit."""
    rate: float = INFINITE
    """Fastest true change per second."""
    jump: float = INFINITE
    """Change that is allowed at once, whatever the rate (noise, resolution, gusts)."""
    frozen_after: float = INFINITE
    """Seconds without any change after which the sensor counts as frozen."""
    still_low: float = -INFINITE
    still_high: float = INFINITE
    """Values at or beyond these may stand still for ever (a dark night, a calm, fog)."""
    stale_after: float = 60.0
    missing_after: float = 900.0
    """Age in seconds from which an old value is stale, then missing."""
    slack: float = 0.0
    """How far beyond an end of the range still counts as that end: the zero of a good sensor wanders."""
    bad_samples: int = 1
    """Bad readings in a row until the sensor counts as bad, and good ones until it counts as good again."""

    def holds(self, value: float) -> bool:
        """Tell whether a value lies in the range (NaN does not)."""
        return self.low - self.slack <= value <= self.high + self.slack

    def cut(self, value: float) -> float:
        """Return the end of the range for a value just beyond it."""
        return min(max(value, self.low), self.high)


_HOUR = 3600.0
_MINUTE = 60.0
SLACK = 0.01
"""Share of a sensor's range by which its zero may wander."""
BAD_SAMPLES = 3
SLOW_BAD_SAMPLES = 2
"""Bad readings in a row that make a sensor bad; fewer where a minute or more lies between two."""

_MOVEMENT: Mapping[str, tuple[float, float, float, float, float]] = MappingProxyType(
    # name: rate per minute, jump, frozen after (h), may stand still at or below, at or above
    {
        "air_temperature": (1.0, 1.5, 3.0, -INFINITE, INFINITE),
        "air_humidity": (5.0, 8.0, 3.0, 1.0, 99.0),
        "air_co2": (150.0, 250.0, 3.0, -INFINITE, INFINITE),
        "par": (1000.0, 1500.0, INFINITE, -INFINITE, INFINITE),
        "outdoor_temperature": (1.0, 2.0, 6.0, -INFINITE, INFINITE),
        "outdoor_humidity": (5.0, 10.0, 6.0, 1.0, 97.0),
        "global_radiation": (600.0, 900.0, 2.0, 5.0, INFINITE),
        "wind_speed": (20.0, 25.0, 6.0, 0.5, INFINITE),
        "rail_pipe_temperature": (15.0, 15.0, INFINITE, -INFINITE, INFINITE),
        "grow_pipe_temperature": (15.0, 15.0, INFINITE, -INFINITE, INFINITE),
    }
)
"""Rates: fastest change seen in greenhouse logs at a 5-minute step, times about two. Standing still: longer than
any stretch of one unchanging reading at a resolution of 0.1 (1 for CO2) with the sensor's own noise. Lamps alone give
the same light for hours."""


def default_rule(name: str, *, poll_period: float, low: float = -INFINITE, high: float = INFINITE) -> SensorRule:
    """Return the rule of a point: its quantity's row of the table, its range cut to `low` and `high`.

    `poll_period` (seconds) is how often a new value can be expected: three periods make it stale, and twenty, but
    at least 15 minutes, missing. A second sensor moves like the first; a name that is no quantity has
    no movement rule. Setpoints and registers that are no quantity are no sensors: one reading of them counts.
    """
    name = name.removesuffix(TWIN_SUFFIX)
    rate, jump, frozen, still_low, still_high = _MOVEMENT.get(name, (INFINITE, INFINITE, INFINITE, -INFINITE, INFINITE))
    quantity = QUANTITIES.get(name)
    slack, bad_samples = 0.0, 1
    if quantity is not None and quantity.kind is not Kind.SETPOINT:
        low, high = max(low, quantity.low), min(high, quantity.high)
        slack = SLACK * (high - low)
        bad_samples = BAD_SAMPLES if poll_period < _MINUTE else SLOW_BAD_SAMPLES
    return SensorRule(
        low=low,
        high=high,
        rate=rate / _MINUTE,
        jump=jump,
        frozen_after=frozen * _HOUR,
        still_low=still_low,
        still_high=still_high,
        stale_after=3.0 * poll_period,
        missing_after=max(900.0, 20.0 * poll_period),
        slack=slack,
        bad_samples=bad_samples,
    )
