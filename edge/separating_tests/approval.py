"""The grower's approval of one separating test, in a small file: command line and page write it, the daemon reads it.

One approval is one run at most. Before anything is moved the daemon notes in the file that the test begins, and it
begins only once the file says so; whatever dies after that, the note stands and the test is over.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration
from igrow.edge.moment import Moment, from_json, to_json
from igrow.edge.separating_tests.possible import obstacles
from igrow.edge.state_file import alone_in, read_state, write_state

APPROVAL_FILE = "separating_test.json"


@dataclass(frozen=True, slots=True)
class Approval:
    """One approved test, and what became of it."""

    test: str
    by: str
    asked: int
    """Tells one approval from another of the same test."""
    seconds: float
    """How long it waits for its weather."""
    seen: Moment | None = None
    """When the daemon first saw it."""
    begun: Moment | None = None
    """When it began."""
    ended: str = ""
    """How it ended, in words; empty until it has."""

    @property
    def is_over(self) -> bool:
        """Nothing more comes of it."""
        return bool(self.ended)


def approval_file(state_folder: Path) -> Path:
    """Return where the approval is kept."""
    return state_folder / APPROVAL_FILE


def read_approval(path: Path) -> Approval | None:
    """Return the approval in the file; None for none, and for what makes no sense."""
    return approval_of(read_state(path))


def approval_of(content: Mapping[str, object]) -> Approval | None:
    """Return the approval that `to_plain` made plain, or None for anything else."""
    test, by, asked, seconds = (content.get(key) for key in ("test", "by", "asked", "seconds"))
    if not (isinstance(test, str) and isinstance(asked, int) and isinstance(seconds, int | float)):
        return None
    if not math.isfinite(seconds):
        return None
    seen, begun = from_json(content.get("seen")), from_json(content.get("begun"))
    return Approval(test, str(by or ""), asked, float(seconds), seen, begun, str(content.get("ended") or ""))


def to_plain(approval: Approval) -> dict[str, object]:
    """Return the content of the file."""
    return {
        "test": approval.test,
        "by": approval.by,
        "asked": approval.asked,
        "seconds": approval.seconds,
        "seen": approval.seen and to_json(approval.seen),
        "begun": approval.begun and to_json(approval.begun),
        "ended": approval.ended,
    }


def approve(configuration: Configuration, test: str, *, by: str) -> Approval:
    """Let the daemon run one test, once, when its weather comes; a running daemon sees it in its next cycle.

    Args:
        configuration: of the daemon.
        test: its name.
        by: who approves it, for the journal.

    Raises:
        IgrowError: tests are not permitted, this one is not possible here, another one is approved already, or there is
            nowhere to write to.
    """
    found = obstacles(configuration)
    if test not in found:
        raise IgrowError(f"{test[:40]} is no separating test: {', '.join(found)}")
    if found[test]:
        raise IgrowError(f"{test}: {found[test]}")
    seconds = configuration.file.separating_tests.within.total_seconds()
    approval = Approval(test, by, time.time_ns(), seconds)
    path = _path(configuration)
    with alone_in(path.parent):
        before = read_approval(path)
        if before is not None and not before.is_over:
            raise IgrowError(f"{before.test} is approved already, by {before.by}: withdraw it first, or let it end")
        _write(path, approval)
    return approval


def withdraw(configuration: Configuration, *, by: str) -> Approval | None:
    """End the approved test, also while it runs; returns it, or None where nothing was approved.

    Raises:
        IgrowError: there is nowhere to write to.
    """
    path = _path(configuration)
    with alone_in(path.parent):
        approval = read_approval(path)
        if approval is None or approval.is_over:
            return None
        _write(path, replace(approval, ended=f"withdrawn by {by}"))
    return approval


def _path(configuration: Configuration) -> Path:
    path = approval_file(configuration.state_folder)
    if not path.parent.is_dir():
        # Made by root, it would shut out the service's own user.
        raise IgrowError(f"{path.parent}: is not there; the daemon makes it when it first starts")
    return path


def _write(path: Path, approval: Approval) -> None:
    problem = write_state(path, to_plain(approval))
    if problem:
        raise IgrowError(problem)
