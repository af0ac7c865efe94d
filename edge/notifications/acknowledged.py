"""What people have said that they know: by alarm, who and when. It holds until the alarm is over."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from igrow.edge.state_file import read_state, write_state

ACKNOWLEDGED_FILE = "acknowledged.json"


@dataclass(frozen=True)
class Acknowledgement:
    """One alarm that somebody knows of."""

    by: str
    time: float
    """Seconds since 1970 UTC."""


def read_acknowledged(path: Path) -> dict[str, Acknowledgement]:
    """Return the acknowledgements by the alarm's name; entries that make no sense are left out."""
    found = {}
    for name, entry in read_state(path).items():
        if isinstance(entry, Mapping) and isinstance(entry.get("time"), int | float):
            found[name] = Acknowledgement(str(entry.get("by", "")), float(entry["time"]))
    return found


def acknowledge(path: Path, names: Collection[str], by: str, time: float, active: Collection[str]) -> str:
    """Add acknowledgements and forget those of alarms that are over; returns an empty text or why it failed."""
    kept = {name: one for name, one in read_acknowledged(path).items() if name in active}
    kept |= {name: Acknowledgement(by, time) for name in names}
    return write_state(path, {name: {"by": one.by, "time": one.time} for name, one in kept.items()})
