"""Reads the configuration again while control goes on: a file on a share that hangs must not hold a cycle.

And says what of it a running daemon can take over.
"""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration, load_configuration
from igrow.edge.hand_off import HandOff

RELOAD_SECONDS = 30.0
"""How long the files of a configuration are waited for."""


class Reloading:
    """The newest attempt to read the configuration."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._task: asyncio.Task[Configuration] | None = None
        self._asked_again = False
        """What is being read may be older than what was asked for last."""

    def start(self) -> bool:
        """Begin to read; tell whether nobody was at it already."""
        if self._task is not None:
            self._asked_again = True
            return False
        self._asked_again = False
        self._task = asyncio.get_running_loop().create_task(self._read())
        return True

    def take(self) -> Configuration | None:
        """Return a configuration that has been read, once; None while there is none.

        Raises IgrowError or OSError, once, for one that is faulty or could not be read in time.
        """
        if self._task is None or not self._task.done():
            return None
        task, self._task = self._task, None
        if self._asked_again:
            self.start()
        return task.result()

    def close(self) -> None:
        """Wait for nothing any more."""
        if self._task is not None:
            self._task.cancel()

    async def _read(self) -> Configuration:
        # A thread of its own each time: one that hung in an earlier attempt is left behind.
        aside = HandOff("configuration")
        try:
            with contextlib.suppress(TimeoutError):
                return await asyncio.wait_for(aside.run(lambda: load_configuration(self._path)), RELOAD_SECONDS)
        finally:
            aside.close(0.0)
        raise IgrowError(f"{self._path}: its files could not be read within {RELOAD_SECONDS:g} s")


def same_registers(old: Configuration, new: Configuration) -> bool:
    """Tell whether the lines can stay as they are."""
    return old.register_map == new.register_map


def refuse_what_needs_a_restart(old: Configuration, new: Configuration) -> None:
    """Raise IgrowError for a change that a running daemon cannot take."""
    for what, before, after in (
        ("the site's name", old.site.name, new.site.name),
        ("state", old.state_folder, new.state_folder),
        ("exchange", old.exchange, new.exchange),
        ("transfer", old.file.transfer, new.file.transfer),
        ("status.port", old.file.status.port, new.file.status.port),
        ("cycle.clock", old.file.cycle.clock, new.file.cycle.clock),
    ):
        if before != after:
            raise IgrowError(f"{new.path}: {what} changed from {before} to {after}, which needs a restart")
