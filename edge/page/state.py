"""The daemon as the page hears it: its newest state, and whether it still says anything new."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.edge.status.client import fetch, last_port, last_state

FRESH_SECONDS = 2.0
"""For so long an answer serves all visitors."""


@dataclass(frozen=True)
class Heard:
    """What is known of the daemon."""

    state: Mapping[str, Any] | None
    """As `/state.json` gives it; the last one that is known, or None."""
    silence: str = ""
    """Why it is not what is now: the daemon does not answer, or completes no cycle. Empty while all is well."""
    since: float | None = None
    """Seconds for which nothing new was heard."""


class Daemon:
    """Asks the daemon, for all visitors together. Safe to call from several threads."""

    def __init__(
        self,
        port: int,
        state_file: Path,
        *,
        late_after: float,
        ask: Callable[[int], Mapping[str, Any]] = fetch,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`late_after` seconds without a new cycle the daemon counts as silent; `state_file` is what it leaves."""
        self._port = port
        self._state_file = state_file
        self._late_after = late_after
        self._ask = ask
        self._monotonic = monotonic
        self._lock = threading.Lock()
        self._asked_at = -math.inf
        self._cycle: object = None
        self._cycle_at = monotonic()
        self._state: Mapping[str, Any] | None = None
        self._problem = ""

    def hear(self) -> Heard:
        """Return what is known now; takes a few seconds at most."""
        with self._lock:
            if self._monotonic() - self._asked_at >= FRESH_SECONDS:
                self._look()
                self._asked_at = self._monotonic()
            silent = self._monotonic() - self._cycle_at
            if self._problem:
                return Heard(self._state, self._problem, silent)
            if silent > self._late_after:
                return Heard(self._state, "the daemon answers, but completes no control cycle any more", silent)
            return Heard(self._state)

    def _look(self) -> None:
        try:
            # A port that the system chose is told in the file that the daemon leaves.
            state = self._ask(self._port or last_port(self._state_file))
        except IgrowError as error:
            self._problem = str(error)
            self._state = self._state or last_state(self._state_file)
            return
        self._problem = ""
        self._state = state
        if state["cycle"] != self._cycle:
            self._cycle, self._cycle_at = state["cycle"], self._monotonic()
