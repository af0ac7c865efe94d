"""Whether the numbers of a unit make sense: after an update of its program a PLC may lay its registers out anew.

Words in another order, registers moved by one, a scale of hundreds: then what is read means nothing, and neither does
what is written. A write would even be confirmed, as a register shows what was put there, while the PLC makes another
number of it. So nothing may be written to such a unit, no heartbeat either, until its numbers make sense again.

One number tells a fault of its sensor. Most numbers of a unit tell that it is the unit: of its setpoints, or of all
else that it shows, as those lie in tables of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from igrow.core.quantities import QUANTITIES, Kind
from igrow.edge.image import Senseless
from igrow.edge.registers.model import TWIN_SUFFIX
from igrow.edge.sensors.rules import SensorRule

FAR = 3.0
"""By how many widths of its range a number lies outside that no fault of a sensor explains."""
NOTHING = 1e-6
"""A smaller number is as good as zero, which is zero in any order and scale: filters end there."""
ENOUGH = 2
"""What speaks against a unit, at the least: so many different numbers, or a setpoint that nobody can have set so."""
FEW = 3
"""So many times as many numbers have to make sense as do not, until a unit does again."""
CALM = 60.0
"""Seconds for which they have to."""
QUESTION = "has its program changed its addresses, scales or order of words?"


@dataclass(frozen=True, slots=True)
class Shown:
    """What a point showed when it was last read."""

    number: float
    turned: bool = False
    """The registers tell that they mean something else (`TurnedWordsError`)."""


class Sense:
    """Remembers which units make no sense."""

    def __init__(self, rules: Mapping[str, SensorRule], units: Mapping[str, str]) -> None:
        """`units` maps points to units; the points without one are one unit's."""
        self._rules = rules
        self._units: dict[str, set[str]] = {}
        for name in rules:
            self._units.setdefault(units.get(name, ""), set()).add(name)
        self._lost: dict[tuple[str, bool], tuple[float, set[str]]] = {}
        """By unit, for its setpoints and for all else: when it was seen last, and the points that told it."""

    def judge(self, shown: Mapping[str, Shown], now: float) -> dict[str, Senseless]:
        """Return the units that make no sense by what their points have shown last; `now` in monotonic seconds."""
        found: dict[str, Senseless] = {}
        for unit, points in self._units.items():
            told: set[str] = set()
            for setpoints in (True, False):
                mine = {name: shown[name] for name in points & shown.keys() if _counts(name, setpoints=setpoints)}
                told |= self._told((unit, setpoints), mine, now)
            if told:
                what = f"the numbers of unit {unit} make no sense ({', '.join(sorted(told))})"
                found[unit] = Senseless(frozenset(points), what, QUESTION)
        return found

    def _told(self, key: tuple[str, bool], shown: Mapping[str, Shown], now: float) -> set[str]:
        """Return the points that tell that these make no sense; empty where they do."""
        known = {name: one for name, one in shown.items() if one.turned or abs(one.number) >= NOTHING}
        against = {name: one for name, one in known.items() if self._is_absurd(name, one)}
        sensible = len(known) - len(against)
        different = {one.number: one for one in against.values()}.values()
        weight = sum(ENOUGH if one.turned and key[1] else 1 for one in different)
        if weight >= ENOUGH and weight > sensible:
            self._lost[key] = now, set(against)
        elif key in self._lost and sensible <= FEW * len(against):
            self._lost[key] = now, self._lost[key][1]
        if key in self._lost and now - self._lost[key][0] > CALM:
            del self._lost[key]
        return self._lost[key][1] if key in self._lost else set()

    def _is_absurd(self, name: str, shown: Shown) -> bool:
        rule = self._rules[name]
        if shown.turned or not math.isfinite(rule.high - rule.low):
            return shown.turned
        far = FAR * (rule.high - rule.low)
        return not rule.low - far <= shown.number <= rule.high + far


def _counts(name: str, *, setpoints: bool) -> bool:
    quantity = QUANTITIES.get(name.removesuffix(TWIN_SUFFIX))
    return quantity is not None and (quantity.kind is Kind.SETPOINT) is setpoints
