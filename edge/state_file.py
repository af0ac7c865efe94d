"""Small JSON files that survive a restart: written whole or not at all, and by the daemon aside."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.core.whole_files import write_whole
from igrow.edge.hand_off import HandOff, LateError

T = TypeVar("T")


def read_state(path: Path) -> dict[str, object]:
    """Return what the file holds; an empty mapping when it is absent or is no JSON object.

    A broken state file is as good as none: what it holds (leases, holds) is safe to forget.
    """
    try:
        return parse_object(path.read_bytes(), str(path))
    except (OSError, IgrowError):
        return {}


def write_state(path: Path, content: Mapping[str, object]) -> str:
    """Replace the file atomically; return an empty text, or one line that says why it could not be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(content, indent=1, sort_keys=True).encode())
    except OSError as error:
        return f"{path}: {error.strerror or error}"
    return ""


@contextlib.contextmanager
def alone_in(folder: Path, *, wait: bool = True) -> Iterator[None]:
    """Let nobody else in who changes what a file of the folder holds: command line, page and daemon all do.

    Raises BlockingIOError where somebody is in it and there is no time to wait; OSError.
    """
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(descriptor)


Stamp = tuple[int, int] | None
"""Tells one state of a file from another; None where it is absent."""


class StateFile:
    """A state file as the control cycle has it: a disk that hangs can neither hold its reader nor its writer.

    People leave such files, by command or on the page, and the daemon answers in them. What it answers never goes over
    something that it has not read.
    """

    def __init__(self, path: Path, aside: HandOff) -> None:
        """Several files may share one `aside`."""
        self.path = path
        self._aside = aside
        self._taken: Stamp = None
        """The state of the file whose content `news` returned last."""
        self._problem = ""
        self.unread = ""
        """Empty while it can be read, else one line."""

    @property
    def problem(self) -> str:
        """Empty while it can be read and written, else one line."""
        return self._aside.problem or self.unread or self._problem

    def news(self) -> dict[str, object] | None:
        """Return what the file holds, nothing where it is absent; None where that has not changed since the last time.

        Nor is there news where it cannot be read, and `unread` says so. Raises LateError.
        """
        stamp, content = self._aside.ask(self._changed)
        if content is not None:
            self._taken = stamp
        return content

    def do(self, work: Callable[[], T]) -> T:
        """Return what `work` with the file returns; raises LateError."""
        return self._aside.ask(work)

    def answer(self, content: Mapping[str, object]) -> None:
        """Replace what `news` returned last, at once where the disk answers in time.

        Not where somebody has changed the file since, or is doing so now: what he leaves is news the next time.
        """
        taken = self._taken

        def now() -> None:
            try:
                with alone_in(self.path.parent, wait=False):
                    if self._stamp() == taken:
                        self._problem = write_state(self.path, content)
            except BlockingIOError:
                pass
            except OSError as error:
                self._problem = f"{self.path}: {error.strerror or error}"

        with contextlib.suppress(LateError):
            self._aside.do(now)

    # aside

    def _changed(self) -> tuple[Stamp, dict[str, object] | None]:
        stamp = self._stamp()
        if stamp == self._taken:
            self.unread = ""
            return stamp, None
        return stamp, self._content()

    def _stamp(self) -> Stamp:
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_mtime_ns, status.st_ino

    def _content(self) -> dict[str, object] | None:
        try:
            content = parse_object(self.path.read_bytes(), self.path.name)
        except FileNotFoundError:
            content = {}
        except (OSError, IgrowError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            self.unread = f"{self.path} cannot be read ({why}), so what it said before goes on"
            return None
        self.unread = ""
        return content
