"""An instant on all clocks of the machine, so that a restart can tell how much time has passed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeGuard

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


@dataclass(frozen=True, slots=True)
class Moment:
    """One instant."""

    boot: str
    """Which start of the machine `monotonic` belongs to; empty where it means nothing to another process."""
    monotonic: float
    time: float | None
    """Seconds since 1970 UTC; None while the clock cannot be trusted."""

    def since(self, earlier: Moment) -> float | None:
        """Return the seconds that passed since `earlier`, or None where no clock can tell.

        While the machine was not started again its monotonic clock tells, however wrong the date is or was.
        """
        if self.boot and self.boot == earlier.boot:
            return max(0.0, self.monotonic - earlier.monotonic)
        if self.time is None or earlier.time is None or self.time < earlier.time:
            return None
        return self.time - earlier.time


def to_json(moment: Moment) -> Mapping[str, object]:
    """Return the moment as plain values."""
    return {"boot": moment.boot, "monotonic": moment.monotonic, "time": moment.time}


def from_json(content: object) -> Moment | None:
    """Return the moment that `to_json` made, or None for anything else."""
    if not isinstance(content, Mapping):
        return None
    boot, monotonic, time = content.get("boot"), content.get("monotonic"), content.get("time")
    if not isinstance(boot, str) or not _is_time(monotonic):
        return None
    return Moment(boot, monotonic, time if _is_time(time) else None)


def _is_time(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def this_boot() -> str:
    """Return the name of this start of the machine; empty where the system has none."""
    try:
        return BOOT_ID.read_text("ascii").strip()
    except (OSError, ValueError):
        return ""
