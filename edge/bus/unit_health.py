"""Which units answer, and how long one that does not is left alone, so that it costs the others nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

LONGEST_REST = 300.0
"""Seconds that a unit is left alone at the most."""


@dataclass
class UnitHealth:
    """What is known of one unit."""

    failures: int = 0
    """Failures in a row."""
    resting_until: float = float("-inf")
    """Monotonic seconds."""
    answers: int = 0
    timeouts: int = 0
    bad_answers: int = 0


class HealthBook:
    """Back-off for each unit: none after one failure, then `step` seconds more for each, up to `LONGEST_REST`.

    One lost frame is no dead unit, hence the first failure is free.
    """

    def __init__(self, monotonic: Callable[[], float], step: float = 2.0) -> None:
        self._monotonic = monotonic
        self._step = step
        self.units: dict[int, UnitHealth] = {}

    def unit(self, device_id: int) -> UnitHealth:
        """Return the record of one unit, begun on first use."""
        return self.units.setdefault(device_id, UnitHealth())

    def rest_left(self, device_id: int) -> float:
        """Return the seconds that the unit is still to be left alone; 0 if it may be asked."""
        health = self.units.get(device_id)
        if health is None or health.failures == 0:
            return 0.0
        return max(0.0, health.resting_until - self._monotonic())

    def answered(self, device_id: int) -> None:
        """Note an answer that fits, be it a refusal."""
        health = self.unit(device_id)
        health.answers += 1
        health.failures = 0

    def failed(self, device_id: int, *, silent: bool, at_least: float = 0.0) -> None:
        """Note a request without an answer that fits; the unit rests `at_least` so many seconds."""
        health = self.unit(device_id)
        health.failures += 1
        if silent:
            health.timeouts += 1
        else:
            health.bad_answers += 1
        rest = min(self._step * (health.failures - 1), LONGEST_REST)
        health.resting_until = self._monotonic() + max(rest, at_least)
