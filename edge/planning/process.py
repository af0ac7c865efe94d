"""The daemon's side of the planning process: `igrow.edge.ports.PlanningService`."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import subprocess
import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import IO

from igrow.core.site import Site
from igrow.edge.planning.messages import MessageError, receive, send
from igrow.edge.ports import Plan, PlanRequest

_log = logging.getLogger("igrow.edge.planning")


@dataclass(frozen=True)
class ProcessLimits:
    """What one plan may cost."""

    timeout_seconds: float = 600.0
    """After which the process is ended."""
    idle_seconds: float = 30.0
    """After which a process without work ends and gives its memory back."""
    memory_bytes: int = 2**30
    """Largest data segment of the process."""


class PlanningProcess:
    """Makes plans in a process of its own; never raises, `health` tells."""

    def __init__(
        self,
        site: Site,
        limits: ProcessLimits | None = None,
        *,
        planner: tuple[str, str] = ("igrow.edge.planning.make_plan", "make_plan"),
    ) -> None:
        """`planner` names the function (site, request) -> Plan that the process calls, by module and name."""
        self._site = site
        self._limits = limits or ProcessLimits()
        self._planner = planner
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="planning")
        self._task: Future[None] | None = None
        self._latest: Plan | None = None
        self._problem = ""
        self._closed = False

    def request(self, request: PlanRequest) -> None:
        """Start to make a plan; when one is being made already, do nothing. Never blocks."""
        if not self.busy and not self._closed:
            self._task = self._worker.submit(self._make, request)

    def latest(self) -> Plan | None:
        """Return the newest finished plan, or None."""
        return self._latest

    @property
    def busy(self) -> bool:
        """A plan is being made."""
        return self._task is not None and not self._task.done()

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""
        return self._problem

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109  # the signature is igrow.edge.ports.PlanningService's
        """Return when no plan is being made any more, or after `timeout` seconds of wall clock."""
        if self._task is not None:
            await asyncio.wait([asyncio.wrap_future(self._task)], timeout=timeout)

    def close(self) -> None:
        """End the process and wait for its thread."""
        self._closed = True
        self._end()
        self._worker.shutdown(wait=True, cancel_futures=True)

    def _make(self, request: PlanRequest) -> None:
        """Ask the process for one plan (in the thread)."""
        try:
            try:
                process = self._running()
                send(_descriptor(process.stdin), (self._site, request))
            except MessageError:
                # It ended for want of work just now; another one takes the request.
                self._end()
                process = self._running()
                send(_descriptor(process.stdin), (self._site, request))
            kind, answer = receive(_descriptor(process.stdout), self._limits.timeout_seconds)
        except (MessageError, OSError) as error:
            code = self._end()
            if not self._closed:
                how = f" (signal {-code})" if code is not None and code < 0 else ""
                self._problem = f"planning: no plan was made: {error}{how}"
                _log.warning("%s", self._problem)
            return
        if kind == "plan":
            self._latest, self._problem = answer, ""
        else:
            self._problem = f"planning: no plan was made: {answer}"
            _log.warning("%s", self._problem)

    def _running(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._process is not None and self._process.poll() is not None:
                self._close_pipes(self._process)
                self._process = None
            if self._process is None:
                command = [
                    sys.executable,
                    "-m",
                    "igrow.edge.planning.worker",
                    *self._planner,
                    str(self._limits.idle_seconds),
                    str(self._limits.memory_bytes),
                ]
                # One thread: the other cores belong to the control cycle and to everything else.
                environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
                environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
                self._process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
                )
            return self._process

    def _end(self) -> int | None:
        """End the process; returns its exit status."""
        with self._lock:
            process, self._process = self._process, None
        if process is None:
            return None
        # A process that has ended by itself keeps its own status; kill changes nothing then.
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.1)
        process.kill()
        status = process.wait()
        self._close_pipes(process)
        return status

    @staticmethod
    def _close_pipes(process: subprocess.Popen[bytes]) -> None:
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()


def _descriptor(stream: IO[bytes] | None) -> int:
    assert stream is not None, "the process is always started with pipes"
    return stream.fileno()
