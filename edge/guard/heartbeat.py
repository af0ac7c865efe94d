"""The number that the heartbeat counts, and what its register tells: a PLC that starts anew has cleared it.

Zero is never counted, as that is what a cleared register holds; only a register of one bit has no other number.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

HEARTBEAT = "heartbeat"
HIGHEST_BEAT = 65_535
"""Where the counter wraps in an unsigned register of 16 bits; smaller registers wrap earlier."""
UNSURE_BEATS = 1000
"""Beats without an answer, of which any one may stand in the register."""
KEPT = "heartbeat_kept"
STRANGE_NUMBERS = 3
"""Readings in a row with ever another number that is not ours, after which somebody else counts there."""


class BeatCount:
    """Counts, and remembers which of its numbers may stand in the register."""

    def __init__(self, highest: int = HIGHEST_BEAT) -> None:
        """`highest` is the largest number that the register takes."""
        self._highest = highest
        self._beat = 0
        self._sure: int | None = None
        self._unsure: deque[int] = deque(maxlen=UNSURE_BEATS)
        self._kept = False
        """The register showed our number when it was last read."""
        self._kept_before = False
        """It did so for the process before this one, of which only that is known."""
        self._shown: int | None = None
        self._strange = 0

    @property
    def kept(self) -> bool:
        """Tell whether the register is one that keeps our number."""
        return self._kept or self._kept_before

    @property
    def problem(self) -> str:
        """Empty, or one line that says that somebody else counts in the register."""
        if self._strange < STRANGE_NUMBERS:
            return ""
        return "somebody else writes the heartbeat's register: does another gateway control this PLC as well?"

    def next(self) -> int:
        """Return the number of the next beat."""
        if self._highest == 1:
            self._beat = 1 - self._beat
        else:
            self._beat = self._beat % self._highest + 1
        return self._beat

    def arrived(self) -> None:
        """The newest beat stands in the register."""
        self._sure = self._beat
        self._unsure.clear()

    def may_have_arrived(self) -> None:
        """The newest beat has had no answer."""
        self._unsure.append(self._beat)

    def was_cleared(self, shown: float) -> bool:
        """Tell whether a reading of the register shows that its PLC has started anew since the one before.

        A register that has kept our number until now and suddenly shows another one was cleared: nobody else writes
        there. One that never kept it (a PLC that takes the number away) proves nothing. Of a process before this one
        the last number is not known, only that it was not zero.
        """
        number, ours = round(shown), (*self._unsure, *(() if self._sure is None else (self._sure,)))
        if self._sure is None:
            # Nothing of ours stands there for certain yet: the next beat must differ from what does.
            self._beat = min(max(0, number), self._highest)
        self._strange = 0 if number in (0, self._shown, *ours) else self._strange + 1
        self._shown = number
        if number in ours:
            self._kept, self._kept_before = True, False
            return False
        cleared = self._kept or (self._kept_before and number == 0 and self._highest > 1)
        self._kept = False
        self._kept_before = self._kept_before and self._sure is None and not cleared
        return cleared

    def is_cleared(self) -> None:
        """The PLC has started anew by what its setpoints show: that the register was cleared is no news any more."""
        self._kept = self._kept_before = False

    def carry_over(self, before: BeatCount) -> None:
        """Go on where the count before a reload stood; the register is the same."""
        self._beat, self._sure, self._unsure = before._beat, before._sure, before._unsure
        self._kept, self._kept_before = before._kept, before._kept_before
        self._shown, self._strange = before._shown, before._strange

    def note(self) -> dict[str, object]:
        """Return what a restart must not forget."""
        return {KEPT: True} if self.kept else {}

    def recall(self, content: Mapping[str, object]) -> None:
        """Take over what the process before this one has noted."""
        self._kept_before = content.get(KEPT) is True
