"""When the next cycle begins: at the next tick of the machine's clock, or when a simulated plant has moved on."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Collection, Mapping
from typing import Protocol

from igrow.edge.clock import PlcClock
from igrow.edge.cycle_result import ReadablePlc
from igrow.edge.sensors import RawReading

PATIENCE = 2.0
"""Wall-clock seconds for a simulated plant to move on; then a cycle runs without it, as it would on a dead line."""


class SignOfLife(Protocol):
    """Hears that a wait goes on as it should (`igrow.edge.systemd_notify.SystemdNotifier`)."""

    feed_every: float
    """Seconds between two signs that it can rely on; may be infinite."""

    def still_waiting(self) -> None:
        """Take note that the next cycle is not due yet."""


class Pace(Protocol):
    """Separates one cycle from the next."""

    async def wait(self, life: SignOfLife) -> None:
        """Return when the next cycle is due; let `life` hear of a long wait."""


class TickPace:
    """A tick each `interval` seconds; ticks missed by a long cycle are left out, not made up for."""

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._next = time.monotonic()

    async def wait(self, life: SignOfLife) -> None:
        """Sleep until the next tick."""
        now = time.monotonic()
        due = max(self._next, now)
        while (rest := due - time.monotonic()) > life.feed_every:
            await asyncio.sleep(life.feed_every)
            life.still_waiting()
        await asyncio.sleep(max(0.0, rest))
        self._next = due + self._interval


class FollowedPlant:
    """A simulated plant whose clock sets the pace; stands between the cycle and the PLC.

    `wait` reads until the plant's clock has moved by the interval (in lock-step: at all) and keeps that reading
    for the cycle, so that a cycle costs one read, and clock and values belong together.
    """

    def __init__(
        self, plc: ReadablePlc, clock: PlcClock, *, names: Collection[str], interval: float, lockstep: bool
    ) -> None:
        """`names` are read in each cycle whatever their poll period, as that is in the plant's time."""
        self._plc = plc
        self._clock = clock
        self._names = tuple(names)
        self._interval = 0.0 if lockstep else interval
        self._kept: Mapping[str, RawReading] | None = None

    async def wait(self, life: SignOfLife) -> None:
        """Return when the plant has moved on, or when it has not for `PATIENCE` seconds, too soon to tell `life`."""
        before = self._clock.monotonic()
        patience_ends = time.monotonic() + PATIENCE
        while True:
            readings = await self._plc.read(self._names)
            reading = readings.get("plc_clock")
            if reading is not None and reading.error is None and reading.value is not None:
                moved = self._clock.follow(reading.value)
                if moved and self._clock.monotonic() - before >= self._interval:
                    break
            if time.monotonic() >= patience_ends:
                break
            await asyncio.sleep(0.002 if self._interval == 0.0 else 0.02)
        self._kept = readings

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, RawReading]:
        """Return the reading that `wait` has kept; without one, read."""
        kept, self._kept = self._kept, None
        return kept if kept is not None else await self._plc.read(names or self._names)
