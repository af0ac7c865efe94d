"""The last day as the page draws it: a few values, a point every five minutes."""

from __future__ import annotations

from collections import deque

from igrow.edge.image import Quality
from igrow.edge.ports import Snapshot

SPACING = 300.0
"""Seconds of plant time between two points."""
POINTS = 288
"""A day."""
DRAWN = ("air_temperature", "air_humidity", "air_co2", "global_radiation", "outdoor_temperature")

Series = tuple[tuple[float, float], ...]


class History:
    """Collects points from snapshots; bounded."""

    def __init__(self) -> None:
        self._values: dict[str, deque[tuple[float, float]]] = {}
        self._newest = float("-inf")

    def add(self, snapshot: Snapshot) -> None:
        """Keep a point of each drawn value and setpoint, where the last is old enough."""
        time = snapshot.time
        if time is None or (time - self._newest < SPACING and time >= self._newest):
            return
        if time < self._newest:
            self._values.clear()  # the plant's clock was set back: what was drawn lies in no order any more
        self._newest = time
        for name in DRAWN:
            value = snapshot.values.get(name)
            if value is not None and value.value is not None and value.quality is Quality.GOOD:
                self._append(name, time, value.value)
        for name, setpoint in snapshot.setpoints.items():
            if setpoint.shown is not None:
                self._append(name, time, setpoint.shown)

    def series(self, name: str) -> Series:
        """Return (seconds since 1970 UTC, value), oldest first."""
        return tuple(self._values.get(name, ()))

    def _append(self, name: str, time: float, value: float) -> None:
        self._values.setdefault(name, deque(maxlen=POINTS)).append((time, value))
