"""The alarms that are active: each is raised once, changes its text quietly, and is cleared once."""

from __future__ import annotations

from collections.abc import Callable

from igrow.edge.alarm_levels import Level, usual_level
from igrow.edge.records import AlarmRecord


class AlarmBoard:
    """Keeps active alarms by name and tells `record` when one comes or goes."""

    def __init__(self, record: Callable[[AlarmRecord], None]) -> None:
        self._record = record
        self._active: dict[str, AlarmRecord] = {}
        self._calm_since: dict[str, float] = {}

    @property
    def active(self) -> tuple[AlarmRecord, ...]:
        """The active alarms, oldest first."""
        return tuple(self._active.values())

    def set(
        self,
        name: str,
        text: str,
        monotonic: float,
        time: float | None,
        level: Level | None = None,
        *,
        calm: float = 0.0,
    ) -> None:
        """Raise the alarm `name`, or clear it when `text` is empty and has been for `calm` seconds.

        So what comes and goes by the minute is one alarm. Without a `level` it has that of its kind.
        """
        known = self._active.get(name)
        level = level or usual_level(name)
        if text:
            self._calm_since.pop(name, None)
            if known is None:
                self._active[name] = AlarmRecord(time, monotonic, name, True, text, level)
                self._record(self._active[name])
            elif known.text != text:
                self._active[name] = AlarmRecord(known.time, known.monotonic, name, True, text, level)
        elif known is not None and monotonic - self._calm_since.setdefault(name, monotonic) >= calm:
            del self._active[name], self._calm_since[name]
            self._record(AlarmRecord(time, monotonic, name, False, known.text, level))
