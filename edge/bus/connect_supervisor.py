"""Keeps a line up: server down at boot, lost later, idle socket closed. It never gives up and never hurries."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Protocol

from igrow.edge.bus.errors import NotConnectedError

LONGEST_WAIT = 10.0
"""Seconds between two attempts."""
SETTLED = 1.0
"""Seconds after which a line that is lost was no failed attempt."""

_log = logging.getLogger(__name__)


class Line(Protocol):
    """What the supervisor needs to know of a link."""

    @property
    def connected(self) -> bool:
        """Tell whether the line is up."""
        ...

    async def open(self) -> None:
        """Connect; raises NotConnectedError."""
        ...

    def close(self) -> None:
        """Drop the line."""
        ...


class ConnectSupervisor:
    """Opens the line, waits until it is lost, opens it again.

    The wait between attempts doubles from `first_wait` to `LONGEST_WAIT`; a line that held for `SETTLED` seconds, or on
    which a unit answered, is opened again at once; one that broke sooner counts as a failed attempt, so that a server
    which accepts and hangs up is not stormed.
    """

    def __init__(
        self,
        line: Line,
        name: str,
        *,
        monotonic: Callable[[], float],
        first_wait: float = 0.5,
    ) -> None:
        self._line = line
        self._name = name
        self._monotonic = monotonic
        self._first_wait = first_wait
        self._lost = asyncio.Event()
        self._attempt_over = asyncio.Event()
        self._hurried = asyncio.Event()
        self._served = False
        self._task: asyncio.Task[None] | None = None
        self.connects = 0
        """How often the line came up."""

    def start(self) -> None:
        """Begin, in the background."""
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._run(), name=f"connect {self._name}")

    def lost(self) -> None:
        """Hear from the line that it is gone."""
        self._attempt_over.clear()
        self._lost.set()

    def served(self) -> None:
        """Hear that a unit has answered on the line."""
        self._served = True

    def hurry(self) -> None:
        """Do not wait for the next attempt to connect, this once."""
        if self._task is not None and not self._line.connected:
            self._attempt_over.clear()
            self._hurried.set()

    async def attempt(self) -> None:
        """Wait for the end of the attempt to connect that is under way, if any."""
        if self._task is not None and not self._line.connected:
            await self._attempt_over.wait()

    async def close(self) -> None:
        """Stop, and drop the line."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None
        self._attempt_over.set()
        self._line.close()

    async def _run(self) -> None:
        wait = 0.0
        complained = ""
        while True:
            self._attempt_over.clear()
            self._lost.clear()
            try:
                await self._line.open()
            except NotConnectedError as error:
                if str(error) != complained:  # say it once, not every ten seconds of a long night
                    _log.warning("%s; trying on", error)
                    complained = str(error)
                wait = min(max(2 * wait, self._first_wait), LONGEST_WAIT)
            else:
                since, self._served = self._monotonic(), False
                self.connects += 1
                _log.info("bus %s: connected", self._name)
                complained = ""
                self._attempt_over.set()
                await self._lost.wait()
                held = self._monotonic() - since
                _log.warning("bus %s: the line was lost after %.0f s", self._name, held)
                wait = 0.0 if held >= SETTLED or self._served else min(max(2 * wait, self._first_wait), LONGEST_WAIT)
            if wait > 0:
                self._attempt_over.set()
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(self._hurried.wait(), wait)
                self._hurried.clear()
