"""One request at a time: a slot that is handed to the waiting request of highest priority."""

from __future__ import annotations

import asyncio
import heapq

from igrow.edge.bus.errors import NotConnectedError, QueueFullError
from igrow.edge.bus.protocol import Priority


class RequestSlot:
    """A lock whose waiters are served by priority, then in order of arrival, and are never too many.

    When the queue is full, the newcomer takes the place of the last of the least urgent if it is more urgent
    than that one, and is refused otherwise; the refused one gets QueueFullError.
    """

    def __init__(self, longest_queue: int = 64) -> None:
        self._longest_queue = longest_queue
        self._taken = False
        self._closed = False
        self._arrivals = 0
        self._waiting: list[tuple[Priority, int, asyncio.Future[None]]] = []

    async def acquire(self, priority: Priority) -> None:
        """Wait for the turn. Raises QueueFullError, or NotConnectedError once the slot is closed."""
        if self._closed:
            raise NotConnectedError("the bus is closed")
        if not self._taken:
            self._taken = True
            return
        self._make_room(priority)
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._arrivals += 1
        heapq.heappush(self._waiting, (priority, self._arrivals, turn))
        try:
            await turn
        except asyncio.CancelledError:
            if turn.done() and not turn.cancelled() and turn.exception() is None:
                self.release()  # the turn came in the same instant as the cancellation: pass it on
            raise

    def release(self) -> None:
        """Hand the slot to the next in turn."""
        while self._waiting:
            _, _, turn = heapq.heappop(self._waiting)
            if not turn.done():
                turn.set_result(None)
                return
        self._taken = False

    def close(self) -> None:
        """Refuse all who wait and all who will come."""
        self._closed = True
        for _, _, turn in self._waiting:
            if not turn.done():
                turn.set_exception(NotConnectedError("the bus is closed"))
        self._waiting.clear()

    def _make_room(self, priority: Priority) -> None:
        self._waiting = [entry for entry in self._waiting if not entry[2].done()]
        heapq.heapify(self._waiting)
        if len(self._waiting) < self._longest_queue:
            return
        message = f"{len(self._waiting)} requests wait already"
        last = max(self._waiting, key=lambda entry: entry[:2])
        if last[0] <= priority:
            raise QueueFullError(message)
        self._waiting.remove(last)
        heapq.heapify(self._waiting)
        last[2].set_exception(QueueFullError(message))

    @property
    def waiting(self) -> int:
        """Number of requests that wait."""
        return sum(not turn.done() for _, _, turn in self._waiting)
