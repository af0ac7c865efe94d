"""Whether there is enough to judge a change by: a PLC that has started anew shows it in all its registers at once."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from igrow.edge.guard.answers import matches
from igrow.edge.guard.causes import FALLBACK
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.power_up import Look, started_anew
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality


class Questions:
    """The points that have changed, while too little was read to say by whom."""

    def __init__(self, rules: Mapping[str, PointRule], units: Mapping[str, str], longest: float) -> None:
        """After `longest` seconds a change is judged by what is known."""
        self._rules = rules
        self._decided = [name for name, rule in rules.items() if rule.decided]
        self._units = units
        self._longest = longest
        self._since: dict[str, float] = {}
        self._first: dict[str, Look] = {}
        """What the setpoints of a unit in question showed when they were first seen so."""
        self.names: Collection[str] = ()
        """The points in question."""
        self.wanted: Collection[str] = ()
        """What is to be read to judge them."""

    def carry_over(self, before: Questions, same: Collection[str]) -> None:
        """Go on where the questions before a reload stood; `same` are the points that are the same registers."""
        self._since = {name: at for name, at in before._since.items() if name in same}
        self._first = {name: look for name, look in before._first.items() if name in same}

    def anew(self, looks: Mapping[str, Look]) -> set[str]:
        """Return the setpoints of units that look as if they had started anew: now, or when that was first seen."""
        units = [unit for seen in (self._seen_first(looks), looks) for unit in self._by_unit(seen)]
        return {name for unit in units if started_anew(unit, self._rules) for name in unit}

    def overtaken(self, looks: Mapping[str, Look], restarted: Collection[str]) -> list[dict[str, Look]]:
        """Return, by unit, what was first seen of a start after which somebody has moved one of the setpoints.

        `restarted` are the points whose unit has just shown that it started anew. That was before the move where
        another setpoint shows still what it showed then: a later start would have moved it as well.
        """
        starts = []
        for first in self._by_unit(self._seen_first(looks)):
            again = {name for name in first if _changed(self._first, name) and _changed(looks, name)}
            moved = {n for n in again if not matches(self._rules[n], looks[n].shown, first[n].shown)}
            stays = any(looks[name].at > first[name].at + 1e-6 for name in again - moved)
            told = started_anew(first, self._rules) or (stays and any(name in restarted for name in moved))
            present = {name: looks[name] for name in first if name in looks}
            if moved and told and not started_anew(present, self._rules):
                starts.append(first)
        return starts

    def ask(self, looks: Mapping[str, Look], changed: Collection[str], image: Image) -> None:
        """Put the changed points in question whose unit has not been read as a whole since the last of them was seen.

        A reading of the same sweep does not count: one half of it may lie before a PLC's start, the other after it.
        What was seen changed is read again as well: one word of a number may have been read before the other was set.
        What has changed in a unit is judged together, as it may have one cause.
        """
        self._since = {name: self._since.get(name, looks[name].at) for name in changed}
        names: set[str] = set()
        wanted: set[str] = set()
        for unit in {self._units.get(name, "") for name in changed}:
            since = {name: at for name, at in self._since.items() if self._units.get(name, "") == unit}
            missing = self._missing(unit, since, image)
            if missing and image.monotonic - min(since.values()) <= self._longest:
                names |= since.keys()
                wanted |= missing
        self.names, self.wanted = names, wanted
        units = {self._units.get(name, "") for name in names}
        first = self._seen_first(looks)
        self._first = {name: look for name, look in first.items() if self._units.get(name, "") in units}

    def judged(self, names: Collection[str]) -> None:
        """Forget what was first seen of these points; what they show from now on is another matter."""
        self._since = {name: at for name, at in self._since.items() if name not in names}
        self._first = {name: look for name, look in self._first.items() if name not in names}

    def _seen_first(self, looks: Mapping[str, Look]) -> dict[str, Look]:
        """Return these looks, each as it was when it first showed something new in the present question.

        A start is told by what all show together; a hand, or a write of ours, may follow before that is judged.
        """
        return {**looks, **{n: first for n, first in self._first.items() if first.changed or not _changed(looks, n)}}

    def _by_unit(self, looks: Mapping[str, Look]) -> list[dict[str, Look]]:
        units = {self._units.get(name, "") for name in looks}
        return [{n: look for n, look in looks.items() if self._units.get(n, "") == unit} for unit in sorted(units)]

    def _missing(self, unit: str, since: Mapping[str, float], image: Image) -> set[str]:
        last = max(since.values())
        others = {other for other in (*self._decided, HEARTBEAT, FALLBACK) if self._units.get(other, "") == unit}
        return {other for other in others if not _is_newer(other, last, image)}


def disturbed(points: Mapping[str, PointMemory], image: Image) -> set[str]:
    """Return the points whose PLC was silent, fell back or started anew, and that were not looked at since.

    A hand that comes after that could not be told from it. A point that was never read is left out: it cannot be.
    """
    return {
        name
        for name, memory in points.items()
        if memory.is_to_be_seen and image.reaches(name) and math.isfinite(image.value_of(name).age)
    }


def cannot_be_read(name: str, memory: PointMemory, image: Image, patience: float) -> bool:
    """Tell whether a point was not read for `patience` seconds, although its unit has been answering all the time."""
    since = memory.answering_since
    long = since is not None and image.monotonic - since > patience
    return long and image.reaches(name) and image.value_of(name).quality is Quality.MISSING


def _changed(looks: Mapping[str, Look], name: str) -> bool:
    return name in looks and looks[name].changed


def _is_newer(name: str, since: float, image: Image) -> bool:
    """Tell whether a point was read after that; one that cannot be read is not waited for."""
    value = image.value_of(name)
    return value.quality is Quality.MISSING or image.monotonic - value.age > since + 1e-6
