"""Rest between requests: slow devices lose what comes too soon after their last answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping


class Pacer:
    """Tells how long to wait before the next request, by a clock that is passed in."""

    def __init__(self, monotonic: Callable[[], float], bus_gap: float, unit_gaps: Mapping[int, float]) -> None:
        """Gaps in seconds; `unit_gaps` by Modbus device id."""
        self._monotonic = monotonic
        self._bus_gap = bus_gap
        self._unit_gaps = {unit: gap for unit, gap in unit_gaps.items() if gap > 0}
        self._bus_free = float("-inf")
        self._unit_free: dict[int, float] = {}

    def wait(self, device_id: int) -> float:
        """Return the seconds to wait before this unit may be asked; 0 if at once."""
        free = max(self._bus_free, self._unit_free.get(device_id, self._bus_free))
        return max(0.0, free - self._monotonic()) if free > float("-inf") else 0.0

    def finished(self, device_id: int) -> None:
        """Note that a request to this unit has just ended, well or not."""
        if self._bus_gap > 0:
            self._bus_free = self._monotonic() + self._bus_gap
        gap = self._unit_gaps.get(device_id)
        if gap is not None:
            self._unit_free[device_id] = self._monotonic() + gap
