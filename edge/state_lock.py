"""One user at a time for a state folder: two daemons would fight over the PLC and over the log."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from igrow_core.errors import IgrowError

LOCK_FILE = "lock"


class InUseError(IgrowError):
    """A daemon runs on this state folder."""


@contextlib.contextmanager
def sole_use(folder: Path) -> Iterator[None]:
    """Hold the state folder for oneself; raises InUseError while another process does.

    The kernel lets go when the process ends, however it ends. Where the disk takes no lock file (read-only, or not
    ours) there is nothing to hold, and control comes first.
    """
    descriptor = _open(folder)
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


def _open(folder: Path) -> int | None:
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    for flags in (os.O_RDWR | os.O_CREAT, os.O_RDONLY):
        with contextlib.suppress(OSError):
            return os.open(folder / LOCK_FILE, flags, 0o640)
    return None
