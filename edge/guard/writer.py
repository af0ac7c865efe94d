"""The one place from which anything is written to a PLC.

It takes `Write`s, which only `igrow.edge.guard.core.guard` makes, and the heartbeat. A test reads the sources and fails
when a second place calls `write`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from igrow.core.errors import IgrowError
from igrow.edge.bus.errors import BusError, RefusedError
from igrow.edge.guard.heartbeat import HEARTBEAT, HIGHEST_BEAT, BeatCount
from igrow.edge.guard.state import Write


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
        """`highest_beat` is the largest number that the heartbeat's register takes."""
        self._plc = plc
        self._has_heartbeat = has_heartbeat
        self.beats = BeatCount(highest_beat)

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
        number = self.beats.next()
        try:
            await self._plc.write(HEARTBEAT, float(number))
        except BusError as error:
            if error.sent or isinstance(error, RefusedError):  # some devices do what they refuse
                self.beats.may_have_arrived()
            return error
        self.beats.arrived()
        return None
