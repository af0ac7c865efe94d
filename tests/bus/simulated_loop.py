"""An event loop whose time is simulated and whose connections are in memory.

Waiting costs nothing and every run with one seed is the same, so that thousands of fault sequences with honest
timeouts take seconds. What runs on it is the code that runs on sockets: it only asks asyncio for the time, for
timers, `create_connection` and `create_server`.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

T = TypeVar("T")
Factory = Callable[[], asyncio.Protocol]


class MemoryTransport(asyncio.Transport):
    """One end of a connection: what is written here is received at the other end, in order."""

    def __init__(self, loop: asyncio.AbstractEventLoop, protocol: asyncio.Protocol) -> None:
        super().__init__()
        self._loop = loop
        self._protocol = protocol
        self._closed = False
        self.other: MemoryTransport | None = None

    def write(self, data: Any) -> None:
        if not self._closed and self.other is not None:
            self._loop.call_soon(self.other.receive, bytes(data))

    def receive(self, data: bytes) -> None:
        if not self._closed:
            self._protocol.data_received(data)

    def is_closing(self) -> bool:
        return self._closed

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._loop.call_soon(self._protocol.connection_lost, None)
            if self.other is not None:
                self._loop.call_soon(self.other.close)

    def abort(self) -> None:
        self.close()


class MemoryServer:
    """What `create_server` returns."""

    def __init__(self, loop: SimulatedLoop, port: int) -> None:
        self._loop = loop
        self._port = port
        self.sockets = (self,)

    def getsockname(self) -> tuple[str, int]:
        return "memory", self._port

    def close(self) -> None:
        self._loop.listeners.pop(self._port, None)

    async def wait_closed(self) -> None:
        pass


class _Selector(selectors.DefaultSelector):
    loop: SimulatedLoop

    def select(self, timeout: float | None = None) -> Any:
        if timeout is None:
            raise RuntimeError("nothing will ever happen: every task waits for another")
        self.loop.now += max(0.0, timeout)
        return super().select(0)


class SimulatedLoop(asyncio.SelectorEventLoop):
    """See the module's docstring."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.listeners: dict[int, Factory] = {}
        selector = _Selector()
        selector.loop = self
        super().__init__(selector)

    def time(self) -> float:
        return self.now

    async def create_server(self, factory: Factory, host: Any = None, port: Any = 0, **_: Any) -> Any:  # type: ignore[override]
        number = port or 50000 + len(self.listeners)
        self.listeners[number] = factory
        return MemoryServer(self, number)

    async def create_connection(self, factory: Factory, host: Any = None, port: Any = None, **_: Any) -> Any:  # type: ignore[override]
        await asyncio.sleep(0.001)
        if port not in self.listeners:
            raise ConnectionRefusedError(f"nobody listens on {port}")
        here, there = factory(), self.listeners[port]()
        ours, theirs = MemoryTransport(self, here), MemoryTransport(self, there)
        ours.other, theirs.other = theirs, ours
        theirs._protocol.connection_made(theirs)
        ours._protocol.connection_made(ours)
        return ours, here


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end in simulated time."""
    with asyncio.Runner(loop_factory=SimulatedLoop) as runner:
        return runner.run(main)
