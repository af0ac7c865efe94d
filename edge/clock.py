"""Clocks: the daemon measures durations on one that never jumps, and dates on one that may be wrong.

Everything inside (ages, slew, leases, budgets) runs on `monotonic`, on which time also passes while the machine sleeps:
no hand, lease or plan waits for it, and what was read before is old afterwards. Dates are for the log, the time of day
and signatures; they come from `true_time`, which is None while the clock cannot be trusted. A simulated plant runs
faster than time, so it publishes its own clock in a register and the daemon follows that (`PlcClock`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

EARLIEST_PLAUSIBLE = datetime(2026, 1, 1, tzinfo=UTC).timestamp()
"""Before this program was made: a clock that shows less was never set. To be moved on with each release."""
LATEST_PLAUSIBLE = datetime(2100, 1, 1, tzinfo=UTC).timestamp()
JUMP_SECONDS = 120.0
"""A difference between the two clocks that grows by more than this at once is a jump, not drift."""
UNEVEN_READINGS = 3
"""Readings in a row, between each of which the date runs at less than half or more than twice the pace of time, after
which the clock counts as one that does not run: a step of a time service is one such reading, a slew none."""
PACE_SECONDS = 1.0
"""Between two looks at the pace, at the least: two clocks are never read in the very same instant."""
PLANT_EARLIEST = datetime(1980, 1, 1, tzinfo=UTC).timestamp()
"""Of a plant's own clock."""
SETTLE_SECONDS = 60.0
"""After a jump the clock must run evenly for this long before it is trusted again."""
MOST_AHEAD = 400 * 86_400.0
"""A clock further ahead of the last time that was trusted needs a witness: no gateway lies in a box for years."""
WITNESS_SECONDS = 86_400.0
"""By how much a PLC's own clock may differ and still be a witness; few of them know about summer time."""
SYNCHRONISED_FILE = Path("/run/systemd/timesync/synchronized")
"""What systemd's time service leaves once it has set the clock (systemd-timesyncd.service(8)); in memory, never on a
disk."""
LARGEST_STEP = 3 * 3600.0
FASTEST_PLANT = 86_400.0
"""What a plant's clock moves on at once, or in seconds per second, at the most; more is a jump."""
PLANT_SETTLES = 3600.0
"""Plant's seconds for which its clock must run evenly after a jump before its dates are believed again."""


def since_boot() -> float:
    """Return seconds on a clock that never jumps and runs on while the machine sleeps."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Clock(Protocol):
    """What time it is, in both senses."""

    def monotonic(self) -> float:
        """Return seconds on a clock that never goes back and never jumps."""

    def true_time(self) -> float | None:
        """Return seconds since 1970 UTC, or None while the clock cannot be trusted (`clock_ok` is false)."""

    @property
    def doubt(self) -> str:
        """Why the date is not trusted, for people; empty while it is."""

    def recall(self, known: float | None) -> None:
        """Learn the last time that an earlier run has trusted, before the first reading."""

    def witness(self, other: float) -> None:
        """Hear what another clock shows now, in seconds since 1970 UTC."""


class TrustedTime:
    """Tells whether a wall clock may be trusted: by its date, by how evenly it runs, and by what was known before.

    A clock is trusted when it shows a plausible date and has run evenly for `SETTLE_SECONDS` since its last jump; at a
    start the last time that is known takes the place of the reading before. One that is years ahead of that is
    not believed however evenly it runs, without a witness: the time service, or the PLC's own clock.
    """

    def __init__(self, synchronised: Callable[[], bool] = SYNCHRONISED_FILE.exists) -> None:
        """`synchronised` tells whether the system's time service has set the clock."""
        self._synchronised = synchronised
        self._offset: float | None = None
        self._paced: tuple[float, float] | None = None
        """When the pace was last looked at, and the offset then."""
        self._uneven = 0
        self._jumped_at = float("-inf")
        self._witness: float | None = None
        self.known: float | None = None
        """The last time that was trusted, in this run or an earlier one."""
        self.jumps = 0
        self.doubt = "it was not read yet"
        """Why the clock is not trusted, for people; empty while it is."""

    def witness(self, offset: float) -> None:
        """Hear what another clock shows, as seconds since 1970 UTC minus monotonic seconds."""
        self._witness = offset

    def judge(self, monotonic: float, wall: float) -> float | None:
        """Return `wall` when it can be trusted at this `monotonic` time, else None."""
        self._watch(monotonic, wall)
        self.doubt = self._doubts(monotonic, wall)
        if self.doubt:
            return None
        self.known = wall
        return wall

    def _watch(self, monotonic: float, wall: float) -> None:
        """Notice a jump since the last reading, or back since the last run."""
        offset = wall - monotonic
        if self._offset is not None and abs(offset - self._offset) > JUMP_SECONDS:
            self.jumps += 1
            # A clock that was never set and now is (1970 to today) has been corrected, not disturbed.
            if self._offset + monotonic >= EARLIEST_PLAUSIBLE:
                self._jumped_at = monotonic
        elif self._offset is None and self.known is not None and wall < self.known - JUMP_SECONDS:
            self._jumped_at = monotonic
        self._offset = offset
        self._watch_pace(monotonic, offset)

    def _watch_pace(self, monotonic: float, offset: float) -> None:
        """Notice a date that stands still, or runs at a pace of its own."""
        before, self._paced = self._paced, self._paced or (monotonic, offset)
        if before is None or monotonic - before[0] < PACE_SECONDS:
            return
        pace = 1.0 + (offset - before[1]) / (monotonic - before[0])
        self._paced = monotonic, offset
        self._uneven = 0 if 0.5 <= pace <= 2.0 else self._uneven + 1
        if self._uneven >= UNEVEN_READINGS:
            self._jumped_at = monotonic

    def _doubts(self, monotonic: float, wall: float) -> str:
        if not EARLIEST_PLAUSIBLE <= wall < LATEST_PLAUSIBLE:
            return f"the clock shows {_date(wall)}, so it was never set"
        if monotonic - self._jumped_at < SETTLE_SECONDS:
            if self._uneven >= UNEVEN_READINGS:
                return f"the clock does not run evenly; it shows {_date(wall)}"
            return f"the clock has jumped, to {_date(wall)}"
        if self.known is None or wall - self.known <= MOST_AHEAD or self._synchronised():
            return ""
        if self._witness is not None and abs(self._witness + monotonic - wall) <= WITNESS_SECONDS:
            return ""
        return (
            f"the clock shows {_date(wall)}, and the last time known is {_date(self.known)}: set it, or connect a time "
            "service that confirms it"
        )


def _date(seconds: float) -> str:
    try:
        return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M UTC")
    except (OverflowError, OSError, ValueError):
        return "no date"


class SystemClock:
    """The machine's clock. Functions are passed in so that tests need no patching."""

    def __init__(self, monotonic: Callable[[], float] = since_boot, wall: Callable[[], float] = time.time) -> None:
        self._monotonic = monotonic
        self._wall = wall
        self._trusted = TrustedTime()

    @property
    def doubt(self) -> str:
        """Why the date is not trusted; empty while it is."""
        return self._trusted.doubt

    def recall(self, known: float | None) -> None:
        """Learn the last time that an earlier run has trusted, before the first reading."""
        self._trusted.known = known

    def witness(self, other: float) -> None:
        """Hear what another clock shows now, in seconds since 1970 UTC."""
        self._trusted.witness(other - self._monotonic())

    def monotonic(self) -> float:
        """Return the machine's monotonic seconds."""
        return self._monotonic()

    def true_time(self) -> float | None:
        """Return the machine's UTC seconds, or None while it cannot be trusted."""
        return self._trusted.judge(self._monotonic(), self._wall())


class PlcClock:
    """Follows the clock that a PLC publishes in a register (`plc_clock`, seconds since 1970 UTC).

    `monotonic` grows with the register and never goes back: a register that jumps, by years ahead or back (a plant that
    was started again), adds nothing. Dates are the register's own, and are believed again once it has run evenly
    for an hour of the plant's. Earlier dates than today's are plausible here, as a simulated plant may replay a year
    long past.
    """

    def __init__(self) -> None:
        self._register: float | None = None
        self._heard_at = 0.0
        self._monotonic = 0.0
        self._even = math.inf

    def follow(self, register: float) -> bool:
        """Take a new reading of the register; tell whether it moved."""
        previous, self._register = self._register, register
        # By the gateway's own clock a jump is told from a plant that runs fast.
        heard_before, self._heard_at = self._heard_at, time.monotonic()
        if previous is None or register == previous:
            return previous is None
        growth = register - previous
        if 0.0 < growth <= max(LARGEST_STEP, FASTEST_PLANT * (self._heard_at - heard_before)):
            self._monotonic += growth
            self._even += growth
        else:
            self._even = 0.0
        return True

    @property
    def doubt(self) -> str:
        """Why the date is not trusted; empty while it is."""
        if self._register is None:
            return "the plant's clock was not read yet"
        if not PLANT_EARLIEST <= self._register < LATEST_PLAUSIBLE:
            return f"the plant's clock shows {_date(self._register)}, so it was never set"
        return f"the plant's clock has jumped, to {_date(self._register)}" if self._even < PLANT_SETTLES else ""

    def recall(self, known: float | None) -> None:
        """Take no note: a simulated plant may begin anywhere in time."""

    def witness(self, other: float) -> None:
        """Take no note: this clock is the plant's."""

    def monotonic(self) -> float:
        """Return the seconds by which the register has grown since it was first read."""
        return self._monotonic

    def true_time(self) -> float | None:
        """Return the register, or None while it cannot be trusted."""
        return None if self.doubt else self._register
