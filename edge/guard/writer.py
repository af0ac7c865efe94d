"""The one place from which anything is written to a PLC.

It takes `Write`s, which only `igrow.edge.guard.core.guard` makes, and the heartbeat. A test reads the sources and fails
when a second place calls `write`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from igrow.core.errors import IgrowError
from igrow.edge.bus.errors import BusError, RefusedError
from igrow.edge.guard.state import Write

HEARTBEAT = "heartbeat"
HIGHEST_BEAT = 65_535
"""Where the counter wraps in an unsigned register of 16 bits; smaller registers wrap earlier."""
UNSURE_BEATS = 1000
"""Beats without an answer, of which any one may stand in the register."""


class WritablePlc(Protocol):
    """What the writer needs of a PLC."""

    async def write(self, name: str, value: float) -> None:
        """Write one point; raises BusError, or IgrowError for a value that its register cannot hold."""


@dataclass(frozen=True, slots=True)
class WriteOutcome:
    """How one write ended, as far as the bus knows; only a later read tells whether it holds."""

    write: Write
    error: IgrowError | None

    @property
    def may_have_arrived(self) -> bool:
        """Tell whether the PLC may have taken the value."""
        return self.error is None or (isinstance(self.error, BusError) and self.error.sent)


class GuardedWriter:
    """Carries out what the guard decided, in its order, and beats the heart."""

    def __init__(self, plc: WritablePlc, *, has_heartbeat: bool, highest_beat: int = HIGHEST_BEAT) -> None:
        """`highest_beat` is the largest number that the heartbeat's register takes; 0 follows it."""
        self._plc = plc
        self._has_heartbeat = has_heartbeat
        self._highest_beat = highest_beat
        self._beat = 0
        self._sure: int | None = None
        self._unsure: deque[int] = deque(maxlen=UNSURE_BEATS)
        self._register_keeps_it = False

    async def carry_out(self, writes: Sequence[Write]) -> list[WriteOutcome]:
        """Write each value once; a failure is returned, never repeated here."""
        outcomes = []
        for write in writes:
            try:
                await self._plc.write(write.point, write.value)
            except IgrowError as error:  # a BusError, or a value that the register cannot hold
                outcomes.append(WriteOutcome(write, error))
            else:
                outcomes.append(WriteOutcome(write, None))
        return outcomes

    async def heartbeat(self) -> BusError | None:
        """Change the heartbeat register, so that the PLC knows that a whole cycle was completed."""
        if not self._has_heartbeat:
            return None
        self._beat = (self._beat + 1) % (self._highest_beat + 1)
        try:
            await self._plc.write(HEARTBEAT, float(self._beat))
        except BusError as error:
            if error.sent or isinstance(error, RefusedError):  # some devices do what they refuse
                self._unsure.append(self._beat)
            return error
        self._sure = self._beat
        self._unsure.clear()
        return None

    def heartbeat_was_lost(self, shown: float | None) -> bool:
        """Tell whether a reading of the heartbeat register shows that its PLC has started anew.

        A register that has kept our number until now and suddenly shows another one was cleared: nobody else writes
        there. One that never kept it (a PLC that takes the number away) proves nothing.
        """
        if shown is None:
            return False
        if self._sure is None:
            # Nothing of ours stands there for certain yet: the next beat must differ from what does.
            self._beat = min(max(0, round(shown)), self._highest_beat)
            return False
        kept = self._register_keeps_it
        self._register_keeps_it = round(shown) in (self._sure, *self._unsure)
        return kept and not self._register_keeps_it
