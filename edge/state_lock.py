"""One user at a time for a state folder: two daemons would fight over the PLC and over the log."""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
from collections.abc import Iterator
from pathlib import Path

from igrow.core.errors import IgrowError

LOCK_FILE = "lock"

_log = logging.getLogger("igrow.edge")


class InUseError(IgrowError):
    """A daemon runs on this state folder, or may do so."""


class StateLock:
    """The lock of a state folder, as its daemon has it: for as long as the process lives."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._descriptor: int | None = None

    def hold(self) -> None:
        """Take the lock; look whether it still is the folder's, and take that of a folder that was put in its place.

        A folder that is removed or moved away takes its lock along, so that another daemon could begin beside this
        one. Raises InUseError while another process has the folder. Where the disk takes no lock file (read-only, or
        not ours) there is nothing to hold, and control comes first.
        """
        if self._descriptor is not None:
            if _is_at(self._folder / LOCK_FILE, self._descriptor):
                return
            _log.warning("%s was taken away or replaced, and its lock with it", self._folder)
        self.let_go()
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
        for flags in (os.O_RDWR | os.O_CREAT, os.O_RDONLY):
            with contextlib.suppress(OSError):
                # Whoever may look into the folder may see that it is in use: another user's daemon, too.
                self._descriptor = os.open(self._folder / LOCK_FILE, flags, 0o644)
                break
        try:
            _lock(self._descriptor, self._folder)
        except InUseError:
            self.let_go()
            raise

    def let_go(self) -> None:
        """Give the lock back; the kernel does so when the process ends, however it ends."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


@contextlib.contextmanager
def daemon_stopped(folder: Path) -> Iterator[None]:
    """Hold the state folder for a command; raises InUseError while a daemon has it, or where that cannot be told.

    A command makes neither the folder nor the lock: made by root, they would shut out the service's own user. Without
    a lock no daemon has run there yet, and there is nothing to hold.
    """
    try:
        descriptor = os.open(folder / LOCK_FILE, os.O_RDONLY)
    except FileNotFoundError:
        descriptor = None
    except OSError as error:
        raise InUseError(
            f"{folder}: whether a daemon is running on it cannot be told: {error.strerror}; call this as the "
            "service's user, such as with `sudo -u igrow`"
        ) from None
    try:
        _lock(descriptor, folder)
        yield
    finally:
        if descriptor is not None:
            os.close(descriptor)


def _is_at(path: Path, descriptor: int) -> bool:
    """Tell whether an open file still is the one that a path names; a disk that fails says nothing against it."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True


def _lock(descriptor: int | None, folder: Path) -> None:
    """Lock the open lock file, if there is one."""
    if descriptor is None:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InUseError(
            f"{folder}: a daemon is running on it; stop it first, such as with `systemctl stop igrow-edge`"
        ) from None
    except OSError:
        pass  # a file system without locks
