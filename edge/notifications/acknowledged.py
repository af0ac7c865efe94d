"""What people have said that they know: by alarm, who and when. It holds until the alarm is over."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from igrow.edge.hand_off import LateError
from igrow.edge.state_file import StateFile, alone_in, read_state, write_state

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
    try:
        with alone_in(path.parent):
            kept = {name: one for name, one in read_acknowledged(path).items() if name in active}
            kept |= {name: Acknowledgement(by, time) for name in names}
            return write_state(path, {name: {"by": one.by, "time": one.time} for name, one in kept.items()})
    except OSError as error:
        return f"{path.parent}: {error.strerror or error}"


class AcknowledgementWatch:
    """Tells of each acknowledgement once, in the daemon's cycle; what a start finds was told before."""

    def __init__(self, file: StateFile, tell: Callable[..., None]) -> None:
        """`tell` takes the kind of an event, and its details by name."""
        self._file = file
        self._tell = tell
        self._known: dict[str, Acknowledgement] | None = None

    def look(self) -> None:
        """Tell what is new; while its disk hangs, later."""
        with contextlib.suppress(LateError):
            found = self._file.do(lambda: read_acknowledged(self._file.path))
            for name, one in found.items():
                if self._known is not None and self._known.get(name) != one:
                    self._tell("acknowledged", alarm=name, by=one.by)
            self._known = found
