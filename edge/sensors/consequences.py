"""What each quality does to control: one table, read by everything that uses an image.

A value in doubt (bad, but in too few readings to act on) counts for control as the last one that was believed.
A value that is not usable for control makes its interlocks take the safe side (`Interlock.when_unknown`), so the
greenhouse is never steered by a number that nobody believes. A value that is not usable for planning keeps new
plans from being made; the valid one runs on until it expires, then the recipe follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from igrow.edge.image import Quality, Value


@dataclass(frozen=True)
class Consequence:
    """What may be done with a value of one quality."""

    control: bool
    """Interlocks and the recipe may use it."""
    planning: bool
    """A plan may start from it."""
    telemetry: bool
    """The trainer may learn from it (the log keeps the others with their quality)."""
    text: str


CONSEQUENCES: Mapping[Quality, Consequence] = MappingProxyType(
    {
        Quality.GOOD: Consequence(True, True, True, "used"),
        Quality.STALE: Consequence(True, False, False, "the last value still guards; no plan starts from it"),
        Quality.OUT_OF_RANGE: Consequence(False, False, False, "not used; interlocks take the safe side"),
        Quality.FROZEN: Consequence(False, False, False, "not used; interlocks take the safe side"),
        Quality.MISSING: Consequence(False, False, False, "not used; interlocks take the safe side"),
        Quality.IMPLAUSIBLE: Consequence(False, False, False, "not used; interlocks take the safe side"),
    }
)


def usable_for_control(value: Value) -> float | None:
    """Return the number that interlocks and the recipe may use, or None."""
    if value.in_doubt:
        return value.believed
    return value.value if CONSEQUENCES[value.quality].control else None


def usable_for_planning(value: Value) -> float | None:
    """Return the number that a plan may start from, or None."""
    return value.value if CONSEQUENCES[value.quality].planning else None
