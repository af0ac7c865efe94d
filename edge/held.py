"""Whether the process was held since a cycle began: stopped by a signal, starved, or with its machine asleep.

What was read before that is not what the plant is now. A write that was decided on it would undo what happened in
between, such as a hand, and a heartbeat would say that somebody had been thinking.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from igrow.edge.clock import since_boot

LONGEST = 60.0
"""Seconds between the beginning of a cycle and its last write, where cycles are no longer apart. A line whose requests
all time out needs half of it."""


CLOCKS: Sequence[Callable[[], float]] = (time.monotonic, since_boot, time.time)
"""The first stands still while the machine sleeps, the second where a hypervisor sleeps; the date is set after that. A
date that is stepped on costs one cycle's writes, which the next one makes good."""


class Held:
    """Measures by several clocks how long ago a cycle began."""

    def __init__(self, interval: float = 0.0, clocks: Sequence[Callable[[], float]] = CLOCKS) -> None:
        """`interval`: seconds from one cycle to the next, half of which a slow line may need."""
        self._longest = max(LONGEST, interval)
        self._clocks = clocks
        self.begin()

    def begin(self) -> None:
        """Take note that a cycle begins."""
        self._began = [clock() for clock in self._clocks]

    @property
    def too_long(self) -> bool:
        """What was read since the cycle began may be too old to act on."""
        return any(clock() - began > self._longest for clock, began in zip(self._clocks, self._began, strict=True))
