"""What the gateway remembers about bundles across restarts: one small JSON file, replaced whole."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path

from igrow.core.whole_files import write_whole


@dataclass
class UpdateState:
    """Times are seconds since 1970 UTC on the plant's clock; bundles are named by identity."""

    active: str | None = None
    previous: str | None = None
    candidate: str | None = None
    candidate_since: float = 0.0
    """Begin of the candidate's shadow run."""
    watch_since: float | None = None
    """Adoption of the active bundle, while it is still on probation."""
    live_before: dict[str, float] = field(default_factory=dict)
    """Live errors of the previous bundle just before that adoption."""
    rejected: dict[str, str] = field(default_factory=dict)
    """Bundles that are never tried again, and why."""
    last_verdict: str = ""
    live_errors: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    """Time and live errors of the bundle then in force, oldest first."""


def load_state(path: Path) -> UpdateState:
    """Read the state; a file that is lost or damaged gives an empty one."""
    try:
        document = json.loads(path.read_text())
        known = {item.name for item in dataclasses.fields(UpdateState)}
        state = UpdateState(**{key: value for key, value in document.items() if key in known})
        state.live_errors = [(float(time), dict(errors)) for time, errors in state.live_errors]
        state.rejected = dict(state.rejected)
    except (OSError, ValueError, TypeError, AttributeError):
        return UpdateState()
    return state


def save_state(path: Path, state: UpdateState) -> None:
    """Replace the state file; raises OSError."""
    write_whole(path, json.dumps(dataclasses.asdict(state)).encode())
