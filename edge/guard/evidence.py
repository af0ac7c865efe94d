"""Whether there is enough to judge a change by: a PLC that has started anew shows it in all its registers at once."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality

HEARTBEAT = "heartbeat"


class Questions:
    """The points that have changed, while too little was read to say by whom."""

    def __init__(self, rules: Mapping[str, PointRule], units: Mapping[str, str], longest: float) -> None:
        """After `longest` seconds a change is judged by what is known."""
        self._decided = [name for name, rule in rules.items() if rule.decided]
        self._units = units
        self._longest = longest
        self._since: dict[str, float] = {}
        self.wanted: Mapping[str, frozenset[str]] = {}
        """By point in question: what is to be read to judge it."""

    def ask(self, changed: Collection[str], image: Image) -> None:
        """Put those of the changed points in question whose unit has not been read as a whole since they changed."""
        self._since = {name: self._since.get(name, image.monotonic - image.value_of(name).age) for name in changed}
        wanted = {
            name: self._missing(name, since, image)
            for name, since in self._since.items()
            if image.monotonic - since <= self._longest
        }
        self.wanted = {name: missing for name, missing in wanted.items() if missing}

    def _missing(self, name: str, since: float, image: Image) -> frozenset[str]:
        unit = self._units.get(name, "")
        others = (other for other in (*self._decided, HEARTBEAT) if self._units.get(other, "") == unit)
        return frozenset(other for other in others if _is_older(other, since, image))


def disturbed(points: Mapping[str, PointMemory], image: Image) -> set[str]:
    """Return the points whose PLC was silent, fell back or started anew since they were last looked at.

    A hand that comes after that could not be told from it. A point that was never read is left out: it cannot be.
    """
    return {
        name
        for name, memory in points.items()
        if memory.was_disturbed and image.reaches(name) and math.isfinite(image.value_of(name).age)
    }


def cannot_be_read(name: str, memory: PointMemory, image: Image, patience: float) -> bool:
    """Tell whether a point was not read for `patience` seconds, although its unit has been answering all the time."""
    since = memory.answering_since
    long = since is not None and image.monotonic - since > patience
    return long and image.reaches(name) and image.value_of(name).quality is Quality.MISSING


def _is_older(name: str, since: float, image: Image) -> bool:
    """Tell whether a point that can be read was not read since then."""
    value = image.value_of(name)
    return value.quality is not Quality.MISSING and image.monotonic - value.age < since - 1e-6
