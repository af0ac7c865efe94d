"""Takes visitors in on a port, and looks away for a second where no handle is left for one.

`asyncio.start_server` tries a hundred times in that case, with a traceback each, and again a second later.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable

_log = logging.getLogger("igrow.edge")
AGAIN_SECONDS = 1.0
WAITING = 100
"""Visitors that the kernel keeps until they are taken in."""
Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class Listener:
    """One listening socket."""

    def __init__(self, address: str, port: int, serve: Serve, *, limit: int) -> None:
        """Listen at once; raises OSError. `serve` gets each visitor, of whose words at most `limit` bytes are kept."""
        self._serve = serve
        self._limit = limit
        self._loop = asyncio.get_running_loop()
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        self._socket = socket.create_server((address, port), family=family, backlog=WAITING)
        self._socket.setblocking(False)
        self._again: asyncio.TimerHandle | None = None
        self._visits: set[asyncio.Task[None]] = set()
        self.port: int = self._socket.getsockname()[1]
        self.problem = ""
        """Empty while visitors can be taken in, else why not."""
        self._listen()

    def close(self) -> None:
        """Take nobody in any more, and turn those away who are here."""
        if self._again is not None:
            self._again.cancel()
        self._loop.remove_reader(self._socket)
        self._socket.close()
        for visit in tuple(self._visits):
            visit.cancel()

    def _listen(self) -> None:
        self._loop.add_reader(self._socket, self._accept)

    def _accept(self) -> None:
        try:
            line, _ = self._socket.accept()
        except (BlockingIOError, InterruptedError, ConnectionAbortedError):
            return
        except OSError as error:
            if not self.problem:
                _log.warning("port %d: nobody can be taken in: %s", self.port, error.strerror)
            self.problem = error.strerror or str(error)
            self._loop.remove_reader(self._socket)
            self._again = self._loop.call_later(AGAIN_SECONDS, self._listen)
            return
        self.problem = ""
        visit = self._loop.create_task(self._take_in(line))
        self._visits.add(visit)
        visit.add_done_callback(self._visits.discard)

    async def _take_in(self, line: socket.socket) -> None:
        await self._serve(*await asyncio.open_connection(sock=line, limit=self._limit))
