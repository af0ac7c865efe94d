"""Keeps across a restart which setpoints were changed by hand at the PLC, so that `kill -9` forgets no hand."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from igrow.edge.state_file import read_state, write_state


class HoldFile:
    """The holds in force, by point, with their end in seconds since 1970 UTC."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._known: set[str] = set()

    def load(self, true_time: float | None) -> dict[str, float]:
        """Return the seconds that each hold still lasts; with a wrong clock, the length that was noted."""
        holds: dict[str, float] = {}
        for name, entry in read_state(self._path).items():
            if not isinstance(entry, Mapping):
                continue
            until, seconds = entry.get("until"), entry.get("seconds")
            if not isinstance(seconds, int | float):
                continue
            left = float(seconds)
            if true_time is not None and isinstance(until, int | float):
                left = min(left, until - true_time)
            if left > 0:
                holds[name] = left
        self._known = set(holds)
        return holds

    def keep(self, held: Mapping[str, float], true_time: float | None) -> None:
        """Note the holds when one came or went."""
        if set(held) == self._known:
            return
        self._known = set(held)
        write_state(
            self._path,
            {
                name: {"seconds": left, "until": None if true_time is None else true_time + left}
                for name, left in held.items()
            },
        )
