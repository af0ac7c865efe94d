"""Our writes in the PLC: taken, on their way, cut or rounded by the device, overdue; or nothing of ours stands there.

A write counts only when a reading taken after it shows the value, or what this device makes of it (a resolution, a
limit or a ramp of its own).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from igrow.core.quantities import with_unit
from igrow.edge.guard.answers import matches, on_the_way, rounds
from igrow.edge.guard.causes import Causes
from igrow.edge.guard.evidence import cannot_be_read
from igrow.edge.guard.findings import Finding, Outcome, Problem
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image


class OurWrites:
    """Judges by what the read-back remembers, and notes there what became of each write."""

    def __init__(
        self,
        rules: Mapping[str, PointRule],
        points: Mapping[str, PointMemory],
        causes: Causes,
        *,
        confirm_within: float,
        respect_hand: float,
    ) -> None:
        """`points` is what is remembered by now; a limit of a device is left alone for `respect_hand` seconds."""
        self._rules = rules
        self._points = points
        self._causes = causes
        self._confirm_within = confirm_within
        self._respect_hand = respect_hand

    def cannot_be_read(self, name: str, image: Image) -> bool:
        """Tell whether no reading of a point is to be waited for."""
        return cannot_be_read(name, self._points[name], image, self._confirm_within)

    def shown_by(self, name: str, shown: float, image: Image) -> list[Finding] | None:
        """Return the findings where a reading shows what stood there or what we wrote; None where it does not."""
        rule, memory, now = self._rules[name], self._points[name], image.monotonic
        if memory.stands is None:
            memory.stands = shown
        stays = matches(rule, shown, memory.stands)
        newest = memory.sent[-1] if memory.sent else None
        if newest is not None and stays and matches(rule, shown, newest.value):
            return [self._confirmed(name, shown)]
        if stays:
            return self._overdue(name, shown, now)
        # A PLC takes writes in turn, so of equal ones it is the first.
        ours = next((sent for sent in (*memory.late, *memory.sent) if matches(rule, shown, sent.value)), None)
        if ours is not None and ours is newest:
            return [self._confirmed(name, shown)]
        if ours is not None:
            memory.applied(ours, shown, now)
            return []
        if memory.answers is not None and matches(rule, shown, memory.answers):
            memory.stands = shown
            return []
        return self._answered(name, shown, image)

    def _answered(self, name: str, shown: float, image: Image) -> list[Finding] | None:
        """Judge a change that may be what the device makes of a write that is on its way."""
        rule, memory, now = self._rules[name], self._points[name], image.monotonic
        if memory.overdue or not memory.sent or memory.stands is None:
            return None
        moving = memory.moved_at > -math.inf and not memory.was_disturbed
        if memory.restarted or (not moving and self._causes.fell_back(name, shown, image)):
            return None
        newest = memory.sent[-1]
        on_its_way = any(on_the_way(rule, memory.stands, sent.value, shown) for sent in memory.sent)
        if on_its_way or memory.is_known_limit(rule, newest.value, shown):
            memory.move_to(shown, now)
            return self._overdue(name, shown, now)
        return [self._confirmed(name, shown)] if rounds(rule, newest.value, shown) else None

    def _confirmed(self, name: str, shown: float) -> Finding:
        memory = self._points[name]
        newest = memory.sent[-1]
        memory.settled(self._rules[name], shown, newest.value)
        return Finding(name, Outcome.CONFIRMED, newest.value, shown, newest.source)

    def _overdue(self, name: str, shown: float, now: float) -> list[Finding]:
        """Judge a write that no reading shows yet; this one is near enough to what stood there."""
        rule, memory = self._rules[name], self._points[name]
        if not memory.sent or memory.overdue or now - memory.waits_since <= self._confirm_within:
            return []
        newest = memory.sent[-1]
        if rounds(rule, newest.value, shown):
            return [self._confirmed(name, shown)]
        there = {other: memory.stands for other, memory in self._points.items()}
        wrote, shows = with_unit(name, newest.value), with_unit(name, shown)
        text = self._causes.crossed(name, there) or f"{wrote} was written to {name}, but the PLC shows {shows}"
        limited = not newest.urgent and memory.is_limited(rule, newest.value)
        if limited:
            memory.learn_limit(newest.value)
            text = f"{text}: it seems to have a limit of its own there"
            memory.settled(rule, shown, newest.value)
            memory.limited_until = now + self._respect_hand
        else:
            memory.overdue, memory.answers = True, None
        memory.problem = Problem(text, minor=limited)
        return [Finding(name, Outcome.UNCONFIRMED, newest.value, shown, newest.source, text)]

    def unread(self, name: str, image: Image) -> list[Finding]:
        """Judge a write to a point that cannot be read, although its unit answers; no reading will ever confirm it."""
        memory = self._points[name]
        late = memory.sent and image.monotonic - memory.sent[-1].at > self._confirm_within
        if not late or not self.cannot_be_read(name, image):
            return []
        newest = memory.sent[-1]
        wrote = with_unit(name, newest.value)
        text = f"{wrote} was written to {name}, which cannot be read back: nobody sees whether it was taken"
        memory.settled(self._rules[name], memory.stands, newest.value)
        memory.problem = Problem(text, minor=True)
        return [Finding(name, Outcome.UNCONFIRMED, newest.value, None, newest.source, text)]
