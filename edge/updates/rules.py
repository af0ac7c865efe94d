"""When bundles are looked for, adopted and taken back, and what the updates need of their surroundings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol


@dataclass(frozen=True)
class UpdateRules:
    """When a bundle is looked for, adopted and taken back; hours are the plant's."""

    check_hours: float = 1.0
    shadow_hours: float = 48.0
    """Length of the shadow run; beyond 24 h, so that there are free runs of a day to compare."""
    watch_hours: float = 72.0
    """Length of the probation after adoption."""
    tolerance: float = 0.02
    """By how much the candidate's errors, over all, may exceed those of the bundle in force."""
    worst: float = 0.5
    """By how much any single one may: two days of weather are few, and chance alone moves a single error far."""
    early_tolerance: float = 0.25
    """During probation, once a day: an excess that ends it at once."""
    live_error_hours: float = 6.0
    """How often the live error is computed."""
    step_seconds: int = 300
    """Grid on which predictions are compared with measurements."""


class Graphs(Protocol):
    """Where graphs run (`igrow.edge.planning.GraphProcess`)."""

    def call(self, function: str, *arguments: object, seconds: float) -> Any:
        """Return what `function`, a "module:name", returns for the arguments.

        Raises the IgrowError that it raises, ProcessError for what takes too much, NotCalledError at the stop.
        """


class UpdateStore(Protocol):
    """What updates need of the store."""

    folder: Path

    def flush(self) -> None:
        """Commit the rows in memory; raises LateError while the disk does not answer."""

    def record_event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        """Add one event, durably."""


class ReportBox(Protocol):
    """Where reports for the trainer are left."""

    def leave_report(self, time: float, name: str, content: Mapping[str, object]) -> None:
        """Leave one report; raises OSError."""
