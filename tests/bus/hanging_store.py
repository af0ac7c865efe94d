"""A store whose disk can hang: the daemon's own `StoreAside`, over records in memory."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any, cast

from igrow.edge.store import StoreAside
from tests.control.control_fakes import MemoryStore

PATIENCE = 0.002
"""Seconds of real time; what waits longer is told to wait by the next cycle."""


class _SlowMemory:
    """Hands every call on to a store in memory, once the disk answers."""

    def __init__(self, store: MemoryStore, answers: threading.Event) -> None:
        self._store = store
        self._answers = answers

    def __getattr__(self, name: str) -> Any:
        call = getattr(self._store, "append" if name == "add" else name)

        def slow(*arguments: Any) -> Any:
            self._answers.wait()
            if name == "add":
                return None
            return call(*arguments)

        return slow


class HangingStore(StoreAside):
    """Hangs from `hang` to `answer`; `kept` is what has reached the disk."""

    def __init__(self) -> None:
        self.kept = MemoryStore()
        self._answers = threading.Event()
        self._answers.set()
        super().__init__(Path("nowhere"), patience=PATIENCE)

    def _open(self, limits: object) -> None:
        self._store = cast(Any, _SlowMemory(self.kept, self._answers))

    def hang(self) -> None:
        self._answers.clear()

    def answer(self) -> None:
        """Answer again; what waited is on the disk when this returns."""
        self._answers.set()
        self._aside.post(lambda: None).result(10.0)
