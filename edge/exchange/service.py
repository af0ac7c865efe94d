"""The daemon's side of the exchange: it starts a courier when one is due, and ends it when it takes too long."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import Protocol

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.core.whole_files import write_whole
from igrow.edge.exchange.courier import STATUS_FILE, Order
from igrow.edge.exchange.outbox import REPORTS
from igrow.edge.exchange.sealing import GRACE_SECONDS
from igrow.edge.hand_off import HandOff, LateError

SOON_SECONDS = 2.0
"""Least time between two rounds, by the wall clock, also for a plant whose days pass in seconds."""
CLOSING_SECONDS = 4.0
"""For the last round, on a stop."""


class FlushingStore(Protocol):
    """What the exchange needs of the store."""

    folder: Path

    def flush(self) -> None:
        """Commit the rows in memory."""


@dataclass(frozen=True)
class TransferRules:
    """How the exchange is used."""

    every: float = 900.0
    """Seconds between two rounds."""
    period: int = 86_400
    budget: int = 256 * 2**20
    deadline: float = 600.0
    known_hosts: str | None = None
    identity: str | None = None


class ExchangeService:
    """Implements `igrow.edge.ports.Exchange`. It touches the gateway's own disk only; never raises, `health` tells."""

    def __init__(
        self,
        url: str,
        folder: Path,
        site: str,
        store: FlushingStore,
        *,
        igrow_version: str,
        rules: TransferRules | None = None,
    ) -> None:
        """`folder` is the exchange's part of the state folder."""
        rules = rules or TransferRules()
        self._rules = rules
        self._folder = folder
        self._store = store
        self._order = Order(
            str(folder), str(store.folder), site, url, igrow_version, None, rules.period, rules.budget,
            known_hosts=rules.known_hosts, identity=rules.identity, deadline=rules.deadline,
        )  # fmt: skip
        self._process: subprocess.Popen[bytes] | None = None
        self._started = float("-inf")
        self._period_sealed = -1
        self._newest: float | None = None
        self._front = float("-inf")
        """The latest time that the clock ever showed."""
        self._seen: tuple[float, float] | None = None
        self._report_waits = False
        self._problem = ""
        # Starting a process and reading what it left touch the gateway's own disk, which may hang as well.
        self._aside = HandOff("exchange")

    @property
    def bundles(self) -> Path:
        """The folder of the signed bundles: the gateway's own copy."""
        return self._folder / "bundles"

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""
        return self._aside.problem or self._problem

    @property
    def busy(self) -> bool:
        """A round is under way."""
        return self._process is not None

    def tick(self, time: float | None) -> None:
        """Start a round where one is due at `time` (seconds since 1970 UTC, None where unknown); never blocks."""
        with contextlib.suppress(LateError):
            self._aside.ask(lambda: self._tick(time))

    def _tick(self, time: float | None) -> None:
        self._reap()
        self._newest = time
        self._look_at(time)
        if self._process is not None:
            return
        since = monotonic() - self._started
        period = -1 if time is None else int((time - GRACE_SECONDS) // self._rules.period)
        soon = (period != self._period_sealed or self._report_waits) and since >= SOON_SECONDS
        if since >= self._rules.every or soon:
            self._start(time, partly=self._report_waits)
            self._period_sealed = period

    def _look_at(self, time: float | None) -> None:
        """Notice a clock that goes back: rounds are too rare to see what lasts for minutes."""
        if time is None:
            return
        if time < self._front - GRACE_SECONDS:
            low, high = self._seen or (time, time)
            self._seen = (min(low, time), max(high, time))
        self._front = max(self._front, time)

    def leave_report(self, time: float, name: str, content: Mapping[str, object]) -> None:
        """Leave a report for the trainer; the next round takes it, and seals the log that belongs to it.

        Raises OSError.
        """
        moment = datetime.fromtimestamp(time, UTC).strftime("%Y%m%dT%H%M%SZ")
        reports = self._folder / REPORTS
        reports.mkdir(parents=True, exist_ok=True)
        write_whole(reports / f"{moment}-{name}.json", (json.dumps(dict(content), indent=2) + "\n").encode())
        self._report_waits = True

    def close(self) -> None:
        """Give a last round a few seconds; what it does not finish, the first one after the next start does."""
        with contextlib.suppress(LateError):
            self._aside.post(self._last_round)
        self._aside.close(CLOSING_SECONDS + 1.0)

    def _last_round(self) -> None:
        until = monotonic() + CLOSING_SECONDS
        try:
            if self._process is None or self._waited(until):
                self._start(self._newest, partly=True)
                self._waited(until)
        finally:
            self._end()

    def _start(self, time: float | None, *, partly: bool) -> None:
        self._store.flush()
        order = replace(self._order, time=time, partly=partly, seen=self._seen)
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "igrow.edge.exchange", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,  # so that it can be ended with all that it starts
            )
            assert self._process.stdin is not None
            # Far below what a pipe holds, so this does not wait for the process to read it.
            self._process.stdin.write(json.dumps(asdict(order)).encode())
            self._process.stdin.close()
        except OSError as error:
            self._problem = f"exchange: no round can be started: {error.strerror or error}"
        self._started = monotonic()
        self._report_waits = False

    def _reap(self) -> None:
        """Look whether the round is over; end one that is too long."""
        process = self._process
        if process is None:
            return
        code = process.poll()
        took = monotonic() - self._started
        if code is None:
            if took > self._rules.deadline + 10.0:
                _kill(process)
                self._problem = f"exchange {self._order.url}: hangs since {took:.0f} s and cannot be ended"
            return
        self._process = None
        if code < 0:
            self._problem = f"exchange {self._order.url}: no end within {self._rules.deadline:g} s"
            return
        try:
            status = parse_object((self._folder / STATUS_FILE).read_bytes(), STATUS_FILE)
            self._problem = str(status.get("problem", ""))
            if self._seen is not None and status.get("seen") == list(self._seen):
                self._seen = None
        except (IgrowError, OSError) as error:
            self._problem = f"exchange: {error}"

    def _waited(self, until: float) -> bool:
        """Wait for the round; tell whether it ended."""
        if self._process is None:
            return True
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.0, until - monotonic()))
        self._reap()
        return self._process is None

    def _end(self) -> None:
        """End the round; one that hangs in the kernel is left behind."""
        if self._process is not None:
            _kill(self._process)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(0.2)


def _kill(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
