"""The number that the heartbeat counts, and what its register tells: a PLC that starts anew has cleared it.

Zero is never counted, as that is what a cleared register holds; only a register of one bit has no other number.
A gateway that answers from what it has read before shows one of our last numbers, never one before what it has shown.
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
KEEPS = "heartbeat_keeps"
CLEARED_FOR_NOTHING = "heartbeat_cleared_for_nothing"
STRANGE_NUMBERS = 3
"""Readings in a row with ever another number that is not ours, after which somebody else counts there."""
LATE_BEATS = 10
"""How many beats a reading may lag behind, from a gateway that answers out of its memory."""
END_READINGS = 4
"""Readings in a row of one number, though others were written, after which the register may end there."""
LEAST_END = 127
"""The smallest number at which a register may be believed to end: seven bits."""
NARROW = (0xFF, 0x7F, 0x7FFF)
"""What PLCs keep of a number that they put into a smaller variable."""
HABIT = 3
"""So often a register is cleared, with nothing else changed, until that is the PLC's way of watching it."""
HABIT_BEATS = 500
"""Beats between two clearings after which they are no habit."""


class BeatCount:
    """Counts, and remembers which of its numbers may stand in the register."""

    def __init__(self, highest: int = HIGHEST_BEAT) -> None:
        """`highest` is the largest number that the register takes."""
        self._highest = highest
        self._beat = 0
        self._sure = False
        """One of our numbers certainly stood in the register."""
        self._ours: deque[int] = deque(maxlen=UNSURE_BEATS)
        """The numbers that a reading may show, oldest first."""
        self._kept = False
        """The register showed our number when it was last read."""
        self._kept_before = False
        """It did so for the process before this one, of which only that is known."""
        self._keeps = False
        """It has done so at any time, in this process or the one before."""
        self._shown: int | None = None
        self._arrived_since = False
        """A beat has arrived since the register was last read."""
        self._same = 0
        """Readings in a row of one number, though others have arrived."""
        self._newer = False
        """The last reading showed one of our numbers for the first time."""
        self._strange = 0
        self._starting = False
        """The register was cleared, and has not shown our number since."""
        self._idle = 0
        """Clearings in a row after which nothing else had changed."""
        self._since_cleared = 0

    @property
    def kept(self) -> bool:
        """Tell whether the register is one that keeps our number."""
        return self._kept or self._kept_before

    @property
    def unheard(self) -> bool:
        """Tell whether the register, which keeps our numbers, showed none of them that is newer than the one before.

        Who answers may not listen, or shows what was so before a silence.
        """
        return self._keeps and not self._newer

    @property
    def problem(self) -> str:
        """Empty, or one line that says what is wrong with the register."""
        if self._strange >= STRANGE_NUMBERS:
            return "somebody else writes the heartbeat's register: does another gateway control this PLC as well?"
        if self._keeps and self._same > LATE_BEATS:
            return (
                f"the heartbeat's register stands at {self._shown}, whatever is written: "
                "does a gateway answer for a PLC that is not there?"
            )
        return ""

    def next(self) -> int:
        """Return the number of the next beat."""
        if self._keeps and self._same >= END_READINGS and self._shown is not None and self._shown >= LEAST_END:
            # Where it would end if it had less room than the map says; if it has not, this costs nothing.
            self._highest = min(self._highest, self._shown)
        if self._highest == 1:
            self._beat = 1 - self._beat
        else:
            self._beat = self._beat + 1 if self._beat < self._highest else 1
        self._since_cleared += 1
        return self._beat

    def arrived(self) -> None:
        """The newest beat stands in the register."""
        self._sure = self._arrived_since = True
        self._ours.append(self._beat)
        # In a register of few numbers an old one comes again soon.
        while len(self._ours) > (LATE_BEATS if self._highest >= LEAST_END else 1):
            self._ours.popleft()

    def may_have_arrived(self) -> None:
        """The newest beat has had no answer."""
        self._ours.append(self._beat)

    def was_cleared(self, shown: float) -> bool:
        """Tell whether a reading of the register shows that its PLC has started anew since the one before.

        A register that has kept our number until now and suddenly shows another one was cleared: nobody else writes
        there. One that never kept it (a PLC that takes the number away) proves nothing, nor one that is cleared again
        and again while all else stays. Of a process before this one the last number is not known, only that it was not
        zero.
        """
        number, before = round(shown), self._shown
        if not self._sure:
            # Nothing of ours stands there for certain yet: the next beat must differ from what does.
            self._beat = min(max(0, number), self._highest)
        self._same = self._same + self._arrived_since if number == before else 0
        self._shown, self._arrived_since = number, False
        ours = number in self._ours or self._is_an_end(number) or self._is_cut_off(number)
        self._newer = number != before and ours
        self._strange = 0 if number in (0, before) or ours else self._strange + 1
        if ours:
            while number in self._ours and self._ours[0] != number:
                self._ours.popleft()
            self._kept, self._keeps, self._kept_before, self._starting = True, True, False, False
            return False
        if number == before:
            return False
        cleared = self._kept or self._starting or (self._kept_before and number == 0 and self._highest > 1)
        # What it has kept comes back only after that, in a PLC that loads it when it is up already.
        self._starting = cleared and number == 0
        self._kept = False
        self._kept_before = self._kept_before and not self._sure and not cleared
        return cleared and not (number == 0 and self._is_habit())

    def _is_an_end(self, number: int) -> bool:
        """Tell whether a smaller register ends there, which newer numbers have reached; a start hardly brings it."""
        return number in NARROW and self._keeps and number < self._beat

    def _is_cut_off(self, number: int) -> bool:
        """Tell whether it is what a smaller variable keeps of one of ours; from then on none is counted beyond it."""
        for most in NARROW:
            if number and self._keeps and any(one > most and one & most == number for one in self._ours):
                self._highest = min(self._highest, most)
                return True
        return False

    def _is_habit(self) -> bool:
        self._idle = self._idle + 1 if self._since_cleared <= HABIT_BEATS else 1
        self._since_cleared = 0
        return self._idle > HABIT

    def meant_a_start(self, *, seen: bool) -> None:
        """The PLC has started anew by what its setpoints show; `seen`: the register was read with them.

        Where it was not, that it will show another number is no news any more.
        """
        self._idle = 0
        if not seen:
            self._kept = self._kept_before = False

    def carry_over(self, before: BeatCount) -> None:
        """Go on where the count before a reload stood; the register is the same."""
        for name, value in vars(before).items():
            if name != "_highest":  # that is what the new map says
                setattr(self, name, value)

    def note(self) -> dict[str, object]:
        """Return what a restart must not forget."""
        noted = {KEPT: self.kept, KEEPS: self._keeps, CLEARED_FOR_NOTHING: self._idle}
        return {name: value for name, value in noted.items() if value}

    def recall(self, content: Mapping[str, object]) -> None:
        """Take over what the process before this one has noted."""
        self._kept_before, self._keeps = content.get(KEPT) is True, content.get(KEEPS) is True
        idle = content.get(CLEARED_FOR_NOTHING)
        self._idle = idle if isinstance(idle, int) and not isinstance(idle, bool) else 0
