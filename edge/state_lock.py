"""One user at a time for a state folder: two daemons would fight over the PLC and over the log."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from igrow.core.errors import IgrowError

LOCK_FILE = "lock"


class InUseError(IgrowError):
    """A daemon runs on this state folder, or may do so."""


@contextlib.contextmanager
def sole_use(folder: Path) -> Iterator[None]:
    """Hold the state folder as its daemon, and make it where there is none; raises InUseError while another has it.

    The kernel lets go when the process ends, however it ends. Where the disk takes no lock file (read-only, or not
    ours) there is nothing to hold, and control comes first.
    """
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    descriptor = None
    for flags in (os.O_RDWR | os.O_CREAT, os.O_RDONLY):
        with contextlib.suppress(OSError):
            descriptor = os.open(folder / LOCK_FILE, flags, 0o640)
            break
    with _held(descriptor, folder):
        yield


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
    with _held(descriptor, folder):
        yield


@contextlib.contextmanager
def _held(descriptor: int | None, folder: Path) -> Iterator[None]:
    """Lock the open lock file, if there is one, and close it in the end."""
    try:
        if descriptor is not None:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InUseError(
                    f"{folder}: a daemon is running on it; stop it first, such as with `systemctl stop igrow-edge`"
                ) from None
            except OSError:
                pass  # a file system without locks
        yield
    finally:
        if descriptor is not None:
            os.close(descriptor)
