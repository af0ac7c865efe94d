"""What a start reads of the run before it, in one piece."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from igrow.core.telemetry import Telemetry
from igrow.edge.records import WriteRecord


@dataclass(frozen=True)
class Earlier:
    """What the store knows of the run before this one."""

    time: float | None
    """Of the newest record that has one, seconds since 1970 UTC."""
    state: Mapping[str, object] | None
    """What was noted last for a restart."""
    writes: Sequence[WriteRecord]
    """The rows with outcome "written" of the last 24 h, oldest first."""
    log: Telemetry
    """The last rows."""
