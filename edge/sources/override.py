"""The grower's override: a setpoint by hand, for a lease that ends by itself.

`igrow-edge override` leaves a small file; the daemon looks at it in each cycle. A lease counts from when the daemon
first sees it, on the monotonic clock; the daemon then notes in the file when that was, so that a restart does not
begin it again, and a date that jumps does not end it. The file is read and written aside: while its disk hangs, what
was last read from it goes on.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from igrow.edge.hand_off import LateError
from igrow.edge.image import Image
from igrow.edge.moment import Moment, from_json, to_json
from igrow.edge.sources.decision import Offer
from igrow.edge.state_file import StateFile, read_state, write_state


@dataclass(frozen=True, slots=True)
class Lease:
    """One overridden setpoint."""

    value: float
    seconds: float
    """Length of the lease when it was asked for."""
    until: float | None = None
    """Seconds since 1970 UTC at which it ends, once the daemon has seen it with a trusted clock."""
    seen: Moment | None = None
    """When the daemon first saw it."""


def read_leases(path: Path) -> dict[str, Lease]:
    """Return the leases in the file by setpoint; entries that make no sense are left out."""
    leases: dict[str, Lease] = {}
    for name, entry in read_state(path).items():
        if not isinstance(entry, Mapping):
            continue
        value, seconds, until = entry.get("value"), entry.get("seconds"), entry.get("until")
        if not isinstance(value, int | float) or not isinstance(seconds, int | float):
            continue
        if math.isfinite(value) and math.isfinite(seconds):
            end = float(until) if isinstance(until, int | float) else None
            leases[name] = Lease(float(value), float(seconds), end, from_json(entry.get("seen")))
    return leases


def write_leases(path: Path, leases: Mapping[str, Lease]) -> str:
    """Replace the file; return an empty text or one line that says why it could not be written."""
    return write_state(path, _plain(leases))


def _plain(leases: Mapping[str, Lease]) -> dict[str, object]:
    return {
        name: {"value": x.value, "seconds": x.seconds, "until": x.until, "seen": x.seen and to_json(x.seen)}
        for name, x in leases.items()
    }


class GrowerOverride:
    """Offers what the grower has overridden and not yet been given back."""

    name = "override"

    def __init__(self, file: StateFile, boot: str = "") -> None:
        """`boot` names this start of the machine, while its monotonic clock is the daemon's."""
        self._file = file
        self._boot = boot
        self._stamp: tuple[int, int] | None = None
        self._leases: dict[str, Lease] = {}
        self._ends: dict[str, float] = {}

    def offer(self, image: Image) -> Offer:
        """Return the setpoints whose lease runs."""
        self._look(image)
        running = {name: lease for name, lease in self._leases.items() if self._ends[name] > image.monotonic}
        if not running:
            return Offer("")
        left = min(self._ends[name] for name in running) - image.monotonic
        why = f"overridden by the grower for {left / 60:.0f} min more"
        return Offer(why, {name: lease.value for name, lease in running.items()})

    def _look(self, image: Image) -> None:
        """Take over what the file holds when it has changed."""
        with contextlib.suppress(LateError):
            stamp, leases = self._file.do(self._changed)
            if leases is not None:
                self._stamp = stamp
                self._take(leases, image)

    def _changed(self) -> tuple[tuple[int, int] | None, dict[str, Lease] | None]:
        """Return the file's stamp, and its leases where it has changed (aside)."""
        stamp = self._file_stamp()
        return stamp, (read_leases(self._file.path) if stamp else {}) if stamp != self._stamp else None

    def _take(self, leases: dict[str, Lease], image: Image) -> None:
        now = Moment(self._boot, image.monotonic, image.true_time)
        dated: dict[str, Lease] = {}
        for name, lease in leases.items():
            if lease == self._leases.get(name):
                dated[name] = lease
                continue
            passed = None if lease.seen is None else now.since(lease.seen)
            left = lease.seconds - (passed or 0.0)
            self._ends[name] = now.monotonic + left
            end = None if now.time is None else now.time + left
            dated[name] = replace(lease, until=end if lease.until is None else lease.until, seen=lease.seen or now)
        self._leases = dated
        if dated != leases:
            read = self._stamp
            # Not over another override that the grower has left in the meantime.
            self._file.write(_plain(dated), unless=lambda: self._file_stamp() != read)

    def _file_stamp(self) -> tuple[int, int] | None:
        try:
            status = self._file.path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_ino
