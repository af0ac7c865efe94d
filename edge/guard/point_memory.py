"""What the read-back remembers about one point."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from igrow.edge.guard.answers import matches
from igrow.edge.guard.findings import Problem
from igrow.edge.guard.rules import PointRule
from igrow.edge.guard.state import Write
from igrow.edge.image import Quality, Value

MOST_SENT = 4
"""Writes that are remembered until a reading shows them."""
LATE = 120.0
"""Seconds for which a write that never showed may still be applied by a slow PLC."""


@dataclass(frozen=True, slots=True)
class Sent:
    """A write that may have reached the PLC, and that no reading has shown yet."""

    value: float
    at: float
    source: str = ""
    urgent: bool = False


@dataclass(slots=True)
class PointMemory:
    """Times are the daemon's monotonic seconds."""

    stands: float | None = None
    """What the PLC showed when it was last looked at; None when it never was."""
    answers: float | None = None
    """The write of ours that this is the device's answer to; None where it was found so."""
    sent: list[Sent] = field(default_factory=list)
    """Oldest first."""
    late: list[Sent] = field(default_factory=list)
    """Writes that something else came after before they showed: the PLC may still apply them."""
    moved_at: float = -math.inf
    """When the PLC last moved towards what was sent."""
    applied_last: float | None = None
    """What it moved to, where that was an earlier write of ours and no step of its own."""
    overdue: bool = False
    """What was sent did not show in time; a reading may still show it."""
    hand: float | None = None
    """What a hand has set, while it is respected."""
    held_until: float = -math.inf
    ceiling: float = math.inf
    floor: float = -math.inf
    """Limits of the device itself, learned from what it made of our writes."""
    limited_until: float = math.inf
    """Until when such a limit is left alone; then it is tried again."""
    problem: Problem | None = None
    """What is wrong with our last write."""
    looked_at: float = -math.inf
    heard_at: float | None = None
    """When the unit last answered."""
    answering_since: float | None = None
    """When the unit was heard again after its last silence; None while it is silent."""
    absence: float = 0.0
    """The longest time since the last look that the unit was not heard, or heard no heartbeat."""
    present_absence: float = 0.0
    """How long that has been by now; a PLC may fall back at any time until it ends."""
    was_silent: bool = False
    was_interrupted: bool = False
    """Since the last look its unit did not answer at all for a cycle, or not to each request."""
    fell_back_at: float | None = None
    restarted_at: float | None = None
    """When `plc_fallback`, or a cleared heartbeat register, was seen that no later look has judged."""

    @property
    def shown(self) -> float | None:
        """What stands in the PLC, in terms of what we write."""
        if self.sent and not self.overdue:
            return self.sent[-1].value
        return self.stands if self.answers is None else self.answers

    @property
    def fell_back(self) -> bool:
        """Its PLC said so, and what it put there may not have been looked at yet."""
        return self.fell_back_at is not None

    @property
    def restarted(self) -> bool:
        """Its PLC has started anew, and what that put there may not have been looked at yet."""
        return self.restarted_at is not None

    @property
    def was_disturbed(self) -> bool:
        """Its PLC was silent, fell back or started anew since the last look."""
        return self.was_silent or self.fell_back or self.restarted

    @property
    def is_to_be_seen(self) -> bool:
        """Something has happened to its PLC, and no reading that certainly came after that was looked at."""
        fell_back = self.fell_back_at is not None and self.fell_back_at > self.looked_at + 1e-6
        return self.was_silent or self.restarted or fell_back

    def shows(self, rule: PointRule, value: float) -> bool:
        """Tell whether the PLC itself shows a value."""
        return self.stands is not None and matches(rule, self.stands, value)

    def settle(self, rule: PointRule, target: float | None) -> None:
        """Forget what was wrong with a write that is not wanted any more, or that the point shows by now."""
        if self.problem and (target is None or self.shows(rule, target)):
            self.problem = None

    @property
    def waits_since(self) -> float:
        """Since when the newest write, or the PLC's way to it, has made no progress."""
        return max(self.sent[-1].at, self.moved_at)

    def sent_now(self, write: Write, now: float) -> None:
        """A write leaves."""
        if not self.sent:
            self.moved_at = -math.inf
        self.sent = [*self.sent, Sent(write.value, now, write.source, write.urgent)][-MOST_SENT:]
        self.overdue = False

    def taken_back(self, *, refused: bool) -> None:
        """The newest write never left, or was refused: some devices do what they refuse."""
        newest = self.sent.pop()
        if refused:
            self.late = [*self.late, newest][-MOST_SENT:]

    def is_new(self, value: Value, now: float) -> bool:
        """Tell whether an image's value is a reading that was not judged yet, taken after the newest write."""
        if value.value is None or value.in_doubt or value.quality in (Quality.MISSING, Quality.STALE):
            return False
        read_at = now - value.age
        return read_at > self.looked_at + 1e-6 and (not self.sent or read_at > self.sent[-1].at + 1e-6)

    def move_to(self, shown: float, now: float) -> None:
        """The PLC is on its way to what was sent."""
        self.stands, self.answers, self.moved_at, self.applied_last = shown, None, now, None

    def applied(self, sent: Sent, shown: float, now: float) -> None:
        """The PLC shows an earlier write of ours, and later ones may follow."""
        self.sent = [other for other in self.sent if other.at > sent.at]
        self.late = [other for other in self.late if other.at > sent.at]
        self.move_to(shown, now)
        self.applied_last = shown

    def settled(self, rule: PointRule, shown: float | None, answers: float) -> None:
        """The PLC shows what it makes of our newest write."""
        if shown is not None and not self.shows(rule, shown):
            self._overtaken()
        self.stands, self.answers, self.problem, self.limited_until = shown, answers, None, math.inf
        self._close()
        if shown is not None and shown > self.ceiling:
            self.ceiling = math.inf
        if shown is not None and shown < self.floor:
            self.floor = -math.inf

    def found(self, shown: float) -> None:
        """The PLC shows something that is not ours."""
        self.stands, self.answers, self.problem = shown, None, None
        self.fell_back_at = self.restarted_at = None  # this reading came after it, as it shows what it did
        self._close()

    def is_limited(self, rule: PointRule, written: float) -> bool:
        """Tell whether the PLC stands still short of what was written, as if it had a limit of its own there.

        Outside our limits nothing is left standing, whatever keeps it there.
        """
        stands = self.stands
        if stands is None or not rule.low <= stands <= rule.high:
            return False
        stopped_short = self.moved_at > -math.inf and stands != self.applied_last
        return stopped_short or self.is_known_limit(rule, written, stands)

    def is_known_limit(self, rule: PointRule, written: float, shown: float) -> bool:
        """Tell whether the device answers a write with a limit that is known of it."""
        known = self.ceiling if written > shown else self.floor
        return math.isfinite(known) and matches(rule, shown, known)

    def learn_limit(self, written: float) -> None:
        """Remember where the device stopped."""
        assert self.stands is not None
        if written > self.stands:
            self.ceiling = self.stands
        else:
            self.floor = self.stands

    def hear(self, now: float, *, answers: bool, interrupted: bool, beat_at: float | None) -> None:
        """Take note of whether the unit answers in this cycle, to each request, and when it last got a heartbeat."""
        since = self.heard_at if self.heard_at is not None else now
        self.present_absence = max(now - since, 0.0 if beat_at is None else now - beat_at)
        self.absence = max(self.absence, self.present_absence)
        self.was_silent |= not answers
        self.was_interrupted |= interrupted
        if answers:
            self.heard_at = now
            self.answering_since = now if self.answering_since is None else self.answering_since
        else:
            self.answering_since = None

    def was_looked_at(self, at: float, now: float) -> None:
        """A reading of the point was judged, taken `at`.

        What was noticed of its PLC in the same sweep may have happened after this reading, so it is kept for the next.
        """
        self.looked_at = at
        self.absence = self.present_absence
        self.was_silent = self.was_interrupted = False
        if self.fell_back_at is not None and self.fell_back_at < now:
            self.fell_back_at = None
        if self.restarted_at is not None and self.restarted_at + 1e-6 < at:
            self.restarted_at = None

    def grow_old(self, now: float) -> None:
        """Expect no write any more that is too long ago, and try a limit again that has stood for long enough."""
        self.late = [sent for sent in self.late if now - sent.at <= LATE]
        if self.limited_until <= now:
            self.answers, self.limited_until = None, math.inf

    def _overtaken(self) -> None:
        """The PLC has moved to our newest write, so it takes writes in turn and none before it is still to come."""
        self.sent, self.late = [], []

    def _close(self) -> None:
        self.late = [*self.late, *self.sent][-MOST_SENT:]
        self.sent = []
        self.overdue = False
        self.moved_at = -math.inf
