"""What the processes below this one take, and ending one of them. Others on the machine are never touched."""

from __future__ import annotations

import contextlib
import threading
from types import TracebackType

import psutil


def below(name: str = "") -> list[psutil.Process]:
    """Return the processes that this one started, and those that they did, whose command line begins with a text.

    Begins: a child that was forked a moment ago shows its parent's command line, with whatever stands in it.
    """
    found = []
    for one in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if " ".join(one.cmdline()).startswith(name):
                found.append(one)
    return found


def kill_one(name: str) -> int:
    """Kill a process below this one as soon as one with such a command line is there; returns its id."""
    while True:
        for one in below(name):
            with contextlib.suppress(psutil.Error):
                one.kill()
                return int(one.pid)
        threading.Event().wait(0.1)


class PeakMemory:
    """The largest sum of what all processes below this one hold for themselves, in MB, while it is entered."""

    megabytes = 0.0

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> PeakMemory:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(0.5):
            total = 0
            for one in below():
                with contextlib.suppress(psutil.Error):
                    # Shared pages (of forked workers, of Ray's object store) count once: not with each who maps them.
                    total += one.memory_full_info().uss
            self.megabytes = max(self.megabytes, total / 1e6)
