"""Telling a PLC that has started anew from a hand, where no register says so.

Memory that was never written mostly holds zeros, or what the program sets at power-up, in all setpoints at once. A
person changes one setpoint after the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from igrow.edge.guard.rules import PointRule

SECONDS_PER_HAND = 15.0
"""What a person needs for one setpoint at a PLC's panel, at the least."""


@dataclass(frozen=True, slots=True)
class Look:
    """One setpoint as a reading has just shown it."""

    shown: float
    changed: bool
    """It shows something that neither stood there nor was written."""
    at: float
    """When it was read, in the daemon's monotonic seconds."""
    since: float
    """Seconds since it was looked at before."""
    was_interrupted: bool
    """Its unit did not answer all the time in between."""
    unapplied: bool = False
    """It still shows what stood there before a write of ours."""


def started_anew(looks: Mapping[str, Look], rules: Mapping[str, PointRule]) -> bool:
    """Tell whether the setpoints of one unit look like those of a PLC after power-up.

    At least two do not show what they should, all of them show zero or something outside the limits, at least one
    that has changed shows that; and it came while the unit did not answer each request, or faster than a hand could be.
    """
    changed = [name for name, look in looks.items() if look.changed]
    if not changed or len(changed) + sum(look.unapplied for look in looks.values()) < 2:
        return False
    if not all(look.shown == 0.0 or _outside(rules[name], look.shown) for name, look in looks.items()):
        return False
    if not any(_outside(rules[name], looks[name].shown) for name in changed):
        return False
    interrupted = all(looks[name].was_interrupted for name in changed)
    return interrupted or max(looks[name].since for name in changed) < SECONDS_PER_HAND * len(changed)


def _outside(rule: PointRule, value: float) -> bool:
    return not rule.low <= value <= rule.high
