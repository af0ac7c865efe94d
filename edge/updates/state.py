"""What the gateway remembers about bundles across restarts: one small JSON file, replaced whole."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
from dataclasses import dataclass, field
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.core.whole_files import sync_folder, write_whole


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
    attempt: str | None = None
    """A bundle that is being tried: noted before it begins, so that one that takes the gateway down is known after."""
    rejected: dict[str, str] = field(default_factory=dict)
    """Bundles that are never tried again, and why."""
    last_verdict: str = ""
    live_errors: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    """Time and live errors of the bundle then in force, oldest first."""
    judged: str | None = None
    """The bundle that the newest live errors are of."""
    judged_since: float = 0.0
    """When its first live errors were computed."""

    def keep_up(self, time: float) -> None:
        """Let nothing lie ahead of `time`: a clock that was ahead has been set right, and what it dated begins now."""
        self.candidate_since = min(self.candidate_since, time)
        if self.watch_since is not None:
            self.watch_since = min(self.watch_since, time)
        self.judged_since = min(self.judged_since, time)
        if self.live_errors and self.live_errors[-1][0] > time:
            self.live_errors = [entry for entry in self.live_errors if entry[0] <= time]


def load_state(path: Path) -> UpdateState:
    """Read the state; a file that is lost or damaged gives an empty one."""
    try:
        document = parse_object(path.read_bytes(), str(path))
        known = {item.name for item in dataclasses.fields(UpdateState)}
        state = UpdateState(**{key: value for key, value in document.items() if key in known})
        state.live_before, state.rejected = dict(state.live_before), dict(state.rejected)
        state.live_errors = [(float(time), dict(errors)) for time, errors in state.live_errors]
    except (OSError, IgrowError, ValueError, TypeError):
        return UpdateState()
    names = (state.active, state.previous, state.candidate, state.attempt, state.judged)
    watch_since = 0.0 if state.watch_since is None else state.watch_since
    times = (state.candidate_since, watch_since, state.judged_since)
    errors = (state.live_before, *(errors for _, errors in state.live_errors))
    makes_sense = (
        all(name is None or isinstance(name, str) for name in names)
        and all(map(_is_number, times))
        and all(_is_number(error) for each in errors for error in each.values())
        and all(isinstance(why, str) for why in (state.last_verdict, *state.rejected.values()))
    )
    return state if makes_sense else UpdateState()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def save_state(path: Path, state: UpdateState) -> None:
    """Replace the state file, and return once that will outlive a power cut; raises OSError."""
    write_whole(path, json.dumps(dataclasses.asdict(state)).encode())
    sync_folder(path.parent)


def save_in_place(path: Path, state: UpdateState) -> None:
    """Write a state that has not grown over the file as it is, for a disk without room for another; raises OSError."""
    content = json.dumps(dataclasses.asdict(state)).encode()
    with path.open("r+b") as file:
        size = file.seek(0, os.SEEK_END)
        if len(content) > size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        file.seek(0)
        file.write(content.ljust(size))
        file.flush()
        os.fsync(file.fileno())
