"""What the operator wants of the bundles, whatever the exchange holds: one pinned, or one taken back.

`igrow-edge model pin` and `back` leave a small file; the running daemon looks at it whenever it looks after its
bundles, and a later start does the same. A wish names the bundle that it is about, so that it cannot hit another one.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.state_file import read_state, write_state
from igrow.edge.updates.state import UpdateState

WISHES_FILE = "wishes.json"


@dataclass(frozen=True)
class Wishes:
    """Bundles by identity."""

    pinned: str | None = None
    """Stays in force: no update and no verdict of the daemon's own replaces it."""
    taken_back: str | None = None
    """Gives way to its predecessor, once, and is never tried again."""


def read_wishes(folder: Path) -> Wishes:
    """Return what was asked for last; nothing where the file is absent or makes no sense."""
    content = read_state(folder / WISHES_FILE)
    pinned, taken_back = content.get("pinned"), content.get("taken_back")
    return Wishes(pinned if isinstance(pinned, str) else None, taken_back if isinstance(taken_back, str) else None)


def pin(folder: Path, state: UpdateState) -> Wishes:
    """Ask for the bundle in force to stay; raises IgrowError where there is none."""
    if state.active is None:
        raise IgrowError("no bundle is in force, so there is none to pin")
    return _leave(folder, Wishes(state.active, read_wishes(folder).taken_back))


def unpin(folder: Path) -> Wishes:
    """Let updates replace the bundle in force again; raises IgrowError."""
    return _leave(folder, Wishes(None, read_wishes(folder).taken_back))


def take_back(folder: Path, state: UpdateState) -> Wishes:
    """Ask for the earlier bundle instead of the one in force; raises IgrowError where there is none on the gateway."""
    if state.active is None or state.previous is None:
        raise IgrowError("there is no earlier bundle on this gateway to go back to")
    return _leave(folder, Wishes(None, state.active))


def _leave(folder: Path, wishes: Wishes) -> Wishes:
    if not folder.is_dir():
        # Made by root, it would shut out the service's own user.
        raise IgrowError(f"{folder}: is not there; the daemon makes it when it first starts")
    if problem := write_state(folder / WISHES_FILE, asdict(wishes)):
        raise IgrowError(problem)
    return wishes
