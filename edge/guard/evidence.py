"""Whether there is enough to judge a change by: a PLC that has started anew shows it in all its registers at once."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from igrow.edge.guard.causes import FALLBACK
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality


class Questions:
    """The points that have changed, while too little was read to say by whom."""

    def __init__(self, rules: Mapping[str, PointRule], units: Mapping[str, str], longest: float) -> None:
        """After `longest` seconds a change is judged by what is known."""
        self._decided = [name for name, rule in rules.items() if rule.decided]
        self._units = units
        self._longest = longest
        self._since: dict[str, float] = {}
        self.names: Collection[str] = ()
        """The points in question."""
        self.wanted: Collection[str] = ()
        """What is to be read to judge them."""

    def ask(self, changed: Collection[str], image: Image) -> None:
        """Put the changed points in question whose unit has not been read as a whole since the last of them was seen.

        A reading of the same sweep does not count: one half of it may lie before a PLC's start, the other after it.
        What has changed in a unit is judged together, as it may have one cause.
        """
        self._since = {name: self._since.get(name, image.monotonic - image.value_of(name).age) for name in changed}
        names: set[str] = set()
        wanted: set[str] = set()
        for unit in {self._units.get(name, "") for name in changed}:
            since = {name: at for name, at in self._since.items() if self._units.get(name, "") == unit}
            missing = self._missing(unit, since, image)
            if missing and image.monotonic - min(since.values()) <= self._longest:
                names |= since.keys()
                wanted |= missing
        self.names, self.wanted = names, wanted

    def _missing(self, unit: str, since: Mapping[str, float], image: Image) -> set[str]:
        last = max(since.values())
        others = {other for other in (*self._decided, HEARTBEAT, FALLBACK) if self._units.get(other, "") == unit}
        return {other for other in others if since.get(other) != last and not _is_newer(other, last, image)}


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


def _is_newer(name: str, since: float, image: Image) -> bool:
    """Tell whether a point was read after that; one that cannot be read is not waited for."""
    value = image.value_of(name)
    return value.quality is Quality.MISSING or image.monotonic - value.age > since + 1e-6
