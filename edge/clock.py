"""Clocks: the daemon measures durations on one that never jumps, and dates on one that may be wrong.

Everything inside (ages, slew, leases, budgets) runs on `monotonic`. Dates are for the log, the time of day and
signatures; they come from `true_time`, which is None while the clock cannot be trusted. A simulated plant runs
faster than time, so it publishes its own clock in a register and the daemon follows that (`PlcClock`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Protocol

EARLIEST_PLAUSIBLE = datetime(2024, 1, 1, tzinfo=UTC).timestamp()
"""A clock that shows less was never set (boards without a battery start in 1970)."""
LATEST_PLAUSIBLE = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
JUMP_SECONDS = 120.0
"""A difference between the two clocks that grows by more than this at once is a jump, not drift."""
SETTLE_SECONDS = 60.0
"""After a jump the clock must run evenly for this long before it is trusted again."""


class Clock(Protocol):
    """What time it is, in both senses."""

    def monotonic(self) -> float:
        """Return seconds on a clock that never goes back and never jumps."""

    def true_time(self) -> float | None:
        """Return seconds since 1970 UTC, or None while the clock cannot be trusted (`clock_ok` is false)."""


class TrustedTime:
    """Tells whether a wall clock may be trusted, by watching it against the monotonic clock.

    A clock is trusted when it shows a plausible date and has run evenly for `settle` seconds since its last jump.
    The first reading counts as even, so that a restart does not cost a minute.
    """

    def __init__(self, earliest: float = EARLIEST_PLAUSIBLE, settle: float = SETTLE_SECONDS) -> None:
        self._earliest = earliest
        self._settle = settle
        self._offset: float | None = None
        self._jumped_at = float("-inf")
        self.jumps = 0

    def judge(self, monotonic: float, wall: float) -> float | None:
        """Return `wall` when it can be trusted at this `monotonic` time, else None."""
        offset = wall - monotonic
        if self._offset is not None and abs(offset - self._offset) > JUMP_SECONDS:
            self.jumps += 1
            # A clock that was never set and now is (1970 to today) has been corrected, not disturbed.
            if self._offset + monotonic >= self._earliest:
                self._jumped_at = monotonic
        self._offset = offset
        plausible = self._earliest <= wall < LATEST_PLAUSIBLE
        return wall if plausible and monotonic - self._jumped_at >= self._settle else None


class SystemClock:
    """The machine's clock. Functions are passed in so that tests need no patching."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic, wall: Callable[[], float] = time.time) -> None:
        self._monotonic = monotonic
        self._wall = wall
        self._trusted = TrustedTime()

    def monotonic(self) -> float:
        """Return the machine's monotonic seconds."""
        return self._monotonic()

    def true_time(self) -> float | None:
        """Return the machine's UTC seconds, or None while it cannot be trusted."""
        return self._trusted.judge(self._monotonic(), self._wall())


class PlcClock:
    """Follows the clock that a PLC publishes in a register (`plc_clock`, seconds since 1970 UTC).

    `monotonic` grows with the register and never goes back: a register that jumps backwards (or a plant that was
    started again) adds nothing. Dates are the register's own. Earlier dates than today's are plausible here, as a
    simulated plant may replay a year long past.
    """

    def __init__(self, earliest: float = datetime(1980, 1, 1, tzinfo=UTC).timestamp()) -> None:
        self._earliest = earliest
        self._register: float | None = None
        self._monotonic = 0.0

    def follow(self, register: float) -> bool:
        """Take a new reading of the register; tell whether it moved."""
        previous, self._register = self._register, register
        if previous is None or register == previous:
            return previous is None
        self._monotonic += max(0.0, register - previous)
        return True

    def monotonic(self) -> float:
        """Return the seconds by which the register has grown since it was first read."""
        return self._monotonic

    def true_time(self) -> float | None:
        """Return the register, or None when it was never read or shows a time before it was ever set."""
        register = self._register
        return register if register is not None and self._earliest <= register < LATEST_PLAUSIBLE else None


class FakeClock:
    """A clock that tests move by hand. `wall` None plays a clock that cannot be trusted."""

    def __init__(self, monotonic: float = 0.0, wall: float | None = 1_700_000_000.0) -> None:
        self.now = monotonic
        self.wall = wall

    def advance(self, seconds: float) -> None:
        """Move both clocks."""
        self.now += seconds
        if self.wall is not None:
            self.wall += seconds

    def monotonic(self) -> float:
        """Return the fake monotonic seconds."""
        return self.now

    def true_time(self) -> float | None:
        """Return the fake UTC seconds."""
        return self.wall
