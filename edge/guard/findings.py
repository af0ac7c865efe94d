"""What the read-back finds, for the journal and the guard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from igrow.core.quantities import with_unit
from igrow.edge.guard.state import Request


class Outcome(Enum):
    """What a look at the PLC showed."""

    CONFIRMED = "confirmed"
    UNCONFIRMED = "unconfirmed"
    BY_HAND = "by_hand"
    FALLBACK = "fallback"
    RESTARTED = "restarted"
    CROSSED = "crossed"
    HAND_ENDED = "hand_ended"


@dataclass(frozen=True, slots=True)
class Finding:
    """One outcome at one point."""

    point: str
    outcome: Outcome
    expected: float | None
    shown: float | None
    source: str = ""
    text: str = ""
    """One line for people where a write did not come out as it should."""
    unseen: float = 0.0
    """Seconds since the point was looked at before."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with our last write to a point."""

    text: str
    minor: bool = False
    """The device makes something of its own of it, or cannot be asked; control goes on with that."""


@dataclass(frozen=True, slots=True)
class Hand:
    """A setting by hand that is respected."""

    value: float
    seconds: float
    """How long it still is."""
    stands: bool
    """It is what the PLC shows; otherwise something else has moved the point away."""

    def asked_back(self, point: str) -> Request:
        """Return the request that puts it back."""
        back = with_unit(point, self.value)
        why = f"back to {back}, set by hand at the PLC and respected for {self.seconds / 60:.0f} min more"
        return Request(self.value, "hand", why, at_once=True)


def moved_and_stood(findings: Sequence[Finding], *, briefly: float) -> tuple[set[str], dict[str, float]]:
    """Return the points whose ramps begin where the PLC now stands, and those that go on, with where they stood.

    A PLC that was unseen for at most `briefly` seconds and has started anew was off for a moment only.
    """
    moved: set[str] = set()
    stood: dict[str, float] = {}
    for found in findings:
        off = found.outcome is Outcome.RESTARTED and found.unseen <= briefly
        if found.expected is not None and (found.outcome is Outcome.CROSSED or off):
            stood[found.point] = found.expected
        elif found.outcome not in (Outcome.CONFIRMED, Outcome.HAND_ENDED):
            moved.add(found.point)
    return moved, stood
