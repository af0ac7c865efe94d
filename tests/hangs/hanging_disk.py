"""A disk or a share that stops answering: every call to the file system below a folder hangs, in whatever thread.

The one thread that must never make such a call is that of the control cycle. There it is not made to hang, as the test
itself runs in it: it is noted, with where it came from, and the test fails.
"""

from __future__ import annotations

import builtins
import contextlib
import io
import os
import sqlite3
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

CALLS = (
    "open", "stat", "lstat", "mkdir", "replace", "rename", "unlink", "scandir", "listdir", "statvfs", "fsync",
    "posix_fallocate", "access", "rmdir", "utime",
)  # fmt: skip


class HangingDisk:
    """Hangs from `hang` to `answer`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
        self.folder = folder
        self.held: list[str] = []
        """Where the thread of the control cycle would have hung."""
        self.hung = 0
        """How many calls of other threads hang."""
        self._cycle = threading.current_thread()
        self._answers = threading.Event()
        self._answers.set()
        for name in CALLS:
            monkeypatch.setattr(os, name, self._slowed(getattr(os, name)))
        opened = self._slowed(io.open)
        monkeypatch.setattr(io, "open", opened)
        monkeypatch.setattr(builtins, "open", opened)
        monkeypatch.setattr(sqlite3, "connect", self._slow_connect(sqlite3.connect))

    def hang(self) -> None:
        self._answers.clear()

    def answer(self) -> None:
        self._answers.set()

    def _slowed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def slowed(*arguments: Any, **named: Any) -> Any:
            if not self._answers.is_set() and arguments and self._below(arguments[0]):
                self._wait()
            return call(*arguments, **named)

        return slowed

    def _slow_connect(self, connect: Callable[..., sqlite3.Connection]) -> Callable[..., Any]:
        disk = self

        class SlowConnection(sqlite3.Connection):
            below = False

            def _wait(self) -> None:
                if self.below:
                    disk._wait()

            def execute(self, *arguments: Any) -> Any:
                self._wait()
                return super().execute(*arguments)

            def executemany(self, *arguments: Any) -> Any:
                self._wait()
                return super().executemany(*arguments)

            def executescript(self, *arguments: Any) -> Any:
                self._wait()
                return super().executescript(*arguments)

            def close(self) -> None:
                self._wait()
                super().close()

        def slow_connect(database: Any, *arguments: Any, **named: Any) -> Any:
            path = unquote(urlsplit(database).path) if str(database).startswith("file:") else database
            if self._below(path):
                self._wait()
            connection = connect(database, *arguments, factory=SlowConnection, **named)
            assert isinstance(connection, SlowConnection)
            connection.below = self._below(path)
            return connection

        return slow_connect

    def _below(self, place: object) -> bool:
        if isinstance(place, int):
            with contextlib.suppress(OSError):
                place = Path(f"/proc/self/fd/{place}").readlink()
        return isinstance(place, str | os.PathLike) and Path(os.path.abspath(place)).is_relative_to(self.folder)  # noqa: PTH100

    def _wait(self) -> None:
        if self._answers.is_set():
            return
        if threading.current_thread() is self._cycle:
            self.held.append("".join(traceback.format_stack(limit=12)[:-2]))
            return
        self.hung += 1
        self._answers.wait()
        self.hung -= 1
