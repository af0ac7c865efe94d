"""What explains a value that is not ours, before a hand does: the PLC's own fallback, or two swapped points."""

from __future__ import annotations

from collections.abc import Mapping

from igrow.core.quantities import with_unit
from igrow.edge.guard.answers import matches
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.guard.rules import PointRule
from igrow.edge.image import Image, Quality

FALLBACK = "plc_fallback"


class Causes:
    """Judges by what the read-back remembers."""

    def __init__(
        self,
        rules: Mapping[str, PointRule],
        points: Mapping[str, PointMemory],
        units: Mapping[str, str],
        silence: float,
    ) -> None:
        """`points` is what is remembered by now; after `silence` seconds without a word a PLC may have fallen back."""
        self._rules = rules
        self._points = points
        self._units = units
        self._silence = silence

    def same_unit(self, name: str, other: str) -> bool:
        """Tell whether one unit holds both points."""
        return self._units.get(name, "") == self._units.get(other, "")

    def fell_back(self, name: str, shown: float, image: Image) -> bool:
        """Tell whether the PLC's own fallback, since the last look, explains what it shows."""
        rule, memory = self._rules[name], self._points[name]
        flag, own = image.value_of(FALLBACK), self.same_unit(name, FALLBACK)
        safe = matches(rule, shown, rule.safe)
        if memory.fell_back:
            return safe or (own and flag.says_yes)
        if own and flag.quality is Quality.GOOD and flag.age <= image.value_of(name).age:
            return False  # the PLC itself says that it did not
        return safe and memory.absence > self._silence

    def crossed(self, name: str, shows: Mapping[str, float | None]) -> str:
        """Return a line where a point shows what was written to another one of its unit; `shows` is what all show."""
        rule, shown, own = self._rules[name], shows[name], self._points[name].sent
        for other, there in shows.items():
            sent = self._points[other].sent
            if other == name or not sent or shown is None or there is None or not self.same_unit(name, other):
                continue
            swapped = bool(own) and self._rules[other].same(there, own[-1].value)
            outside = not rule.low <= shown <= rule.high
            if rule.same(shown, sent[-1].value) and (swapped or outside):
                value = with_unit(name, shown)
                return f"{name} shows {value}, which was written to {other}: is the register map right?"
        return ""
