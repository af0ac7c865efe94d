"""Rows of the ledger as control hands them over: what was written to the PLC, and which alarms came and went.

`time` is seconds since 1970 UTC, or None while the clock cannot be trusted: a record without a time keeps its order.
`monotonic` is seconds on the daemon's own clock.
"""

from __future__ import annotations

from dataclasses import dataclass

from igrow.edge.alarm_levels import Level


@dataclass(frozen=True, slots=True)
class WriteRecord:
    """One value that left for the PLC, or that the guard changed or held back: a row of the ledger."""

    time: float | None
    monotonic: float
    point: str
    requested: float | None
    """What the decision asked for; NaN and infinities are stored as None."""
    applied: float | None
    """What was written; None when nothing was."""
    source: str
    """Who asked: override, separating_test, plan, last_plan, recipe, hands_off, interlock, hand or stop."""
    reason: str
    """Why applied differs from requested, or what an interlock or a hand gets back; else empty."""
    outcome: str
    """"written", "clamped" (nothing was written this time), "confirmed", "unconfirmed" or "failed"."""


@dataclass(frozen=True, slots=True)
class AlarmRecord:
    """An alarm that came or went. `name` is stable, so that two records with one name are one alarm's life."""

    time: float | None
    monotonic: float
    name: str
    active: bool
    text: str
    """One line for people: what is wrong, where, what to do."""
    level: Level = Level.WARNING
