"""Work that may hang, done aside: one thread, a bounded queue, and nobody who waits longer than he can afford.

A disk, a share, a graph or a name server can keep a system call for ever, and nothing in the process can end it. So
the thread of the control cycle makes no such call: it hands the work over, and waits for it within a budget, or not at
all. While work hangs, all that was handed over waits behind it, in its order; what the queue cannot hold is refused.

The thread is a daemon thread: no exit of the interpreter waits for it (`concurrent.futures` joins its threads there).
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from igrow.core.errors import IgrowError

T = TypeVar("T")

PATIENCE = 1.0
"""Seconds that somebody waits at most for work that is usually done in milliseconds."""
SHARE = 0.1
"""Share of the time that may be spent on such waits: what bounds one wait does not bound the sum of a slow disk's."""
LATE_AFTER = 5.0
"""Seconds after which work counts as hanging, for people; one slow commit of a memory card does not."""


class LateError(IgrowError):
    """The work is not done yet. It will be, unless it hangs for ever; nothing was undone."""


async def settled(future: Future[T], timeout: float) -> None:  # noqa: ASYNC109 - it ends quietly, it does not cancel
    """Return when the work is done, well or not, or after `timeout` seconds."""
    loop, done = asyncio.get_running_loop(), asyncio.Event()

    def tell(_: Future[T]) -> None:
        with contextlib.suppress(RuntimeError):  # nobody waits any more, not even the loop
            loop.call_soon_threadsafe(done.set)

    future.add_done_callback(tell)
    with contextlib.suppress(TimeoutError):
        await asyncio.wait_for(done.wait(), timeout)


def _heard(future: asyncio.Future[T]) -> None:
    """Whoever awaited the work may have gone: then nobody is to be told of an exception that nobody retrieved."""
    if not future.cancelled():
        future.exception()


class HandOff:
    """A thread for work of one kind, done in the order in which it was handed over."""

    def __init__(
        self,
        name: str,
        *,
        patience: float = PATIENCE,
        share: float = SHARE,
        late_after: float = LATE_AFTER,
        longest_queue: int = 10_000,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`name` says to people what the work is, such as "the log"; times are seconds on `monotonic`."""
        self.name = name
        self._patience = patience
        self._share = share
        self._late_after = late_after
        self._longest_queue = longest_queue
        self._monotonic = monotonic
        self._budget, self._budget_at = patience, monotonic()
        self._queue: deque[tuple[Callable[[], object], Future[object]]] = deque()
        self._present: float | None = None
        self._filled = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False
        self.refused = 0
        """How much work the full queue could not take."""

    def post(self, work: Callable[[], T]) -> Future[T]:
        """Hand work over and go on; the future tells how it ends. Raises LateError where the queue is full."""
        future: Future[T] = Future()
        with self._filled:
            if self._closed or len(self._queue) >= self._longest_queue:
                self.refused += 1
                raise LateError(f"{self.name}: {len(self._queue)} pieces of work wait already")
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=f"aside: {self.name}", daemon=True)
                self._thread.start()
            self._queue.append((work, future))  # type: ignore[arg-type]  # the future of what it returns
            self._filled.notify()
        return future

    def do(self, work: Callable[[], T]) -> T:
        """Return what `work` returns, or raise what it raises; LateError when the budget of waiting is spent.

        The work is done all the same, later.
        """
        future = self.post(work)
        now = self._monotonic()
        self._budget = min(self._patience, self._budget + self._share * (now - self._budget_at))
        try:
            return future.result(self._budget)
        except TimeoutError:
            if future.done():
                return future.result()  # in this very instant; or the work itself raises such an error
            raise LateError(f"{self.name}: not done within {self._patience:g} s") from None
        finally:
            self._budget_at = self._monotonic()
            self._budget = max(0.0, self._budget - (self._budget_at - now))

    def ask(self, work: Callable[[], T]) -> T:
        """Do the same with work that would be pointless later: it is not handed over while earlier work is late."""
        if self._is_late(self._patience):
            raise LateError(f"{self.name}: an earlier piece of work is not done yet")
        return self.do(work)

    async def run(self, work: Callable[[], T], undo: Callable[[T], object] = lambda _: None) -> T:
        """Await what `work` returns, or raise what it raises; LateError at once while earlier work is not done.

        Where the awaiting is cancelled, the work's late result is handed to `undo`, in the thread.
        """
        if self.waiting:
            raise LateError(f"{self.name}: an earlier attempt hangs")
        future = self.post(work)
        awaited = asyncio.wrap_future(future)
        awaited.add_done_callback(_heard)
        try:
            return await asyncio.shield(awaited)
        except asyncio.CancelledError:
            future.add_done_callback(lambda done: undo(done.result()) if done.exception() is None else None)
            raise

    @property
    def waiting(self) -> int:
        """Pieces of work that are not done yet."""
        with self._filled:
            return len(self._queue) + (self._present is not None)

    @property
    def problem(self) -> str:
        """Empty while work gets done, else one line for people."""
        if not self._is_late(self._late_after):
            return ""
        with self._filled:
            late = 0.0 if self._present is None else self._monotonic() - self._present
            waiting = len(self._queue)
        lost = f", {self.refused} could not wait" if self.refused else ""
        return f"{self.name}: no answer for {late:.0f} s from a disk or a share; {waiting} pieces of work wait{lost}"

    def _is_late(self, seconds: float) -> bool:
        with self._filled:
            return self._present is not None and self._monotonic() - self._present > seconds

    def close(self, seconds: float) -> bool:
        """Take no more work; tell whether all of it is done within so many seconds. What is not is left behind."""
        with self._filled:
            self._closed = True
            self._filled.notify()
        if self._thread is not None:
            self._thread.join(seconds)
        return self._thread is None or not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._filled:
                while not self._queue:
                    if self._closed:
                        return
                    self._filled.wait()
                work, future = self._queue.popleft()
                self._present = self._monotonic()
            if future.set_running_or_notify_cancel():
                self._do(work, future)

    def _do(self, work: Callable[[], object], future: Future[object]) -> None:
        try:
            result = work()
        except BaseException as error:
            self._done()
            future.set_exception(error)
        else:
            self._done()
            future.set_result(result)

    def _done(self) -> None:
        """Before anybody hears of it, who may then hand over more at once."""
        with self._filled:
            self._present = None
