"""The heartbeat at the end of each cycle: the unit that hears it was part of the cycle."""

from __future__ import annotations

from igrow.edge.guard import GuardedWriter, Readback
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.image import Image, Quality
from igrow.edge.journal import Journal

MOST_WITHHELD = 2
"""Beats in a row that wait for a reading of their register; a PLC waits for more than three."""


class Heart:
    """Beats, and looks what became of the beats before."""

    def __init__(self, writer: GuardedWriter, readback: Readback, journal: Journal) -> None:
        self._writer = writer
        self._readback = readback
        self._journal = journal
        self._withheld = 0

    def was_cleared(self, image: Image) -> bool:
        """Tell whether the register, where it was read just now, shows that its PLC has started anew."""
        beat = image.value_of(HEARTBEAT)
        if beat.value is None or beat.age > 0.0 or not image.makes_sense(HEARTBEAT):
            return False
        return self._writer.beats.was_cleared(beat.value)

    def meant_a_start(self, image: Image) -> None:
        """Hear that the setpoints of this image show a start of the PLC."""
        self._writer.beats.meant_a_start(seen=image.value_of(HEARTBEAT).age <= 0.0)

    async def beat(self, image: Image) -> None:
        """Tell the PLC that a cycle was completed."""
        error = None
        if image.reaches(HEARTBEAT) and not self._register_is_to_be_read(image):
            error = await self._writer.heartbeat()
            read_now = image.value_of(HEARTBEAT).age <= 0.0
            if error is None and not (read_now and self._writer.beats.unheard):
                self._readback.beat(image.monotonic)
        self._journal.alarm("heartbeat register", self._writer.beats.problem)
        self._journal.alarm("heartbeat", "" if error is None else f"the heartbeat could not be written: {error}")

    def _register_is_to_be_read(self, image: Image) -> bool:
        """Tell whether a beat would wipe out what the register says of its PLC, which has just been interrupted.

        It is waited for in two cycles, so that the heart beats on where the register cannot be read any more.
        """
        beat = image.value_of(HEARTBEAT)
        interrupted = any(HEARTBEAT in points for points in image.interrupted.values())
        unread = interrupted and self._writer.beats.kept and beat.quality is not Quality.MISSING and beat.age > 0.0
        self._withheld = self._withheld + 1 if unread else 0
        return 0 < self._withheld <= MOST_WITHHELD
