"""What the guard knows about each point that may be written."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.agronomy import Place
from igrow.core.errors import IgrowError
from igrow.edge.guard.interlocks import Interlock


class GuardRuleError(IgrowError):
    """A rule that no value can satisfy."""


@dataclass(frozen=True, slots=True)
class PointRule:
    """The limits of one writable point, in the point's unit and in seconds."""

    low: float
    high: float
    safe: float
    """Where the point goes when we stop or let go, and where an unknown beginning begins."""
    slew: float | None = None
    """Largest change per second; None is as fast as one likes."""
    dead_band: float = 0.0
    """A difference up to this is not worth a write."""
    minimum_interval: float = 0.0
    """Seconds between two writes."""
    refresh: float | None = None
    """Write again after this many seconds even when nothing changed: the register expires."""
    daily_budget: int | None = None
    """Writes in any 24 h: the register wears out."""
    resolution: float = 1e-6
    """The smallest difference that the register can show."""
    decided: bool = True
    """A source decides it (a setpoint). Otherwise it is the PLC's own, such as a vent: only interlocks and separating
    tests move it, and give it back; a change there is no hand but the PLC's control."""

    def __post_init__(self) -> None:
        given = (self.low, self.high, self.safe, self.slew, self.dead_band, self.minimum_interval, self.refresh)
        if not all(math.isfinite(number) for number in given if number is not None):
            raise GuardRuleError("limits, slew, dead band, minimum interval and refresh must be finite numbers")
        if not self.low <= self.safe <= self.high:
            raise GuardRuleError(f"safe value {self.safe:g} is outside the limits {self.low:g} to {self.high:g}")
        if self.daily_budget is not None and self.daily_budget < 2:
            raise GuardRuleError("a daily budget under 2 leaves no write in reserve for an interlock")
        if self.daily_budget is not None and self.refresh is not None and self.refresh * self.daily_budget < 172_800:
            raise GuardRuleError(
                f"refreshing every {self.refresh:g} s takes {86_400 / self.refresh:.0f} of {self.daily_budget} writes "
                "a day; at least half must be left"
            )

    @property
    def reserve(self) -> int:
        """Writes of the daily budget that only interlocks and the stop may use."""
        return 0 if self.daily_budget is None else max(1, self.daily_budget // 10)

    def same(self, a: float, b: float) -> bool:
        """Tell whether the register cannot tell two values apart."""
        return abs(a - b) <= 0.51 * self.resolution + 1e-6 * max(abs(a), abs(b))


@dataclass(frozen=True, slots=True)
class GuardRules:
    """All rules: points by name, and the interlocks in order of precedence (the first one wins)."""

    points: Mapping[str, PointRule]
    interlocks: tuple[Interlock, ...] = ()
    crop: Place | None = None
    """The crop's limits and where it stands; None holds none."""
