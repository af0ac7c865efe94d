"""The alarms that are active: each is raised once, changes its text quietly, and is cleared once."""

from __future__ import annotations

from collections.abc import Callable

from igrow.edge.alarm_levels import Level, usual_level
from igrow.edge.ports import AlarmRecord


class AlarmBoard:
    """Keeps active alarms by name and tells `record` when one comes or goes."""

    def __init__(self, record: Callable[[AlarmRecord], None]) -> None:
        self._record = record
        self._active: dict[str, AlarmRecord] = {}

    @property
    def active(self) -> tuple[AlarmRecord, ...]:
        """The active alarms, oldest first."""
        return tuple(self._active.values())

    def set(self, name: str, text: str, monotonic: float, time: float | None, level: Level | None = None) -> None:
        """Raise the alarm `name`, or clear it when `text` is empty; without a `level` it has that of its kind."""
        known = self._active.get(name)
        level = level or usual_level(name)
        if text and known is None:
            alarm = AlarmRecord(time, monotonic, name, True, text, level)
            self._active[name] = alarm
            self._record(alarm)
        elif text and known is not None and known.text != text:
            self._active[name] = AlarmRecord(known.time, known.monotonic, name, True, text, level)
        elif not text and known is not None:
            del self._active[name]
            self._record(AlarmRecord(time, monotonic, name, False, known.text, level))
