"""What goes into a control cycle, and what comes out of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Protocol

from igrow.edge.guard import Verdict
from igrow.edge.image import Image
from igrow.edge.ports import SetpointStatus
from igrow.edge.sensors import RawReading
from igrow.edge.sources import Decision


class ReadablePlc(Protocol):
    """What the cycle needs of a PLC; writing is the guard's affair."""

    async def read(self, names: Collection[str] | None = None) -> Mapping[str, RawReading]:
        """Read the named points, or all that are due; each reading carries its own error."""


@dataclass(frozen=True, slots=True)
class CycleResult:
    """What one cycle did."""

    image: Image
    decision: Decision
    verdict: Verdict
    setpoints: Mapping[str, SetpointStatus]
    seconds: float
    """Wall-clock length of the cycle."""
