"""The one process in which graphs run, so that a graph that hangs, crashes or grows costs the daemon nothing.

`GraphProcess` starts `python -m igrow.edge.planning.worker`, hands it one call at a time and takes the answer back. The
worker bounds its own memory and processor time; here the wall's time is bounded. A process that does not end when it
is killed (stuck in a disk) is left to the kernel.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass
from typing import IO, Any

from igrow.core.errors import IgrowError
from igrow.edge.planning.messages import EndedError, MessageError, receive, send

SEND_SECONDS = 30.0
"""Longest time for a call to reach a process that has just been started on a busy machine."""
FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM)
"""No call ends its own process so: the kernel does where memory is short, whoever took it, or a person."""
END_SECONDS = 1.0
"""How long a killed process is waited for."""


class ProcessError(IgrowError):
    """The call took its process down, or would have: too long, too large, or a crash."""


class NotCalledError(IgrowError):
    """The call was not made, or not finished, for a reason that is not its own: no process, one that somebody else has
    killed, or the daemon's end."""


@dataclass(frozen=True)
class ProcessLimits:
    """What the process may cost."""

    idle_seconds: float = 30.0
    """After which a process without work ends and gives its memory back."""
    memory_bytes: int = 2**30
    """Largest data segment of the process."""


class GraphProcess:
    """Calls functions in a process of their own; several threads may ask, one call is made at a time."""

    def __init__(self, limits: ProcessLimits | None = None) -> None:
        self._limits = limits or ProcessLimits()
        self._turn = threading.Lock()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def call(self, function: str, *arguments: object, seconds: float) -> Any:
        """Return what `function`, a "module:name", returns for the arguments.

        Raises the IgrowError that it raises; ProcessError where it fails otherwise, takes longer than `seconds` (by
        the wall's clock or the processor's), needs too much memory or takes its process down; NotCalledError.
        """
        with self._turn:
            try:
                kind, answer = self._ask((function, arguments, seconds), seconds)
            except OSError as error:
                raise NotCalledError(f"the process cannot be started: {error.strerror or error}") from None
            except MessageError as error:
                status = self._end()
                if self._closed:
                    raise NotCalledError("the daemon is on its way out") from None
                if isinstance(error, EndedError) and -(status or 0) in FROM_OUTSIDE:
                    raise NotCalledError(f"its process was killed{_how(status)}: is memory short?") from None
                raise ProcessError(f"{error}{_how(status)}") from None
            if kind == "failed":
                self._end()  # what failed so may have left little of the process
                raise ProcessError(answer)
        if kind == "raised":
            raise answer
        return answer

    @property
    def pid(self) -> int | None:
        """The process that is running, if any."""
        process = self._process
        return None if process is None or process.poll() is not None else process.pid

    def close(self) -> None:
        """End the process, whatever it does; further calls raise NotCalledError."""
        self._closed = True
        if self._turn.acquire(blocking=False):
            try:
                self._end()
            finally:
                self._turn.release()
        elif (process := self._process) is not None:
            process.kill()  # its pipes belong to the thread that waits there

    def _ask(self, call: object, seconds: float) -> Any:
        """Send a call and wait for its answer; one that found a process that ended for want of work is sent again."""
        for attempt in (1, 2):
            process = self._running()
            try:
                send(_descriptor(process.stdin), call, SEND_SECONDS)
                return receive(_descriptor(process.stdout), seconds)
            except MessageError:
                if attempt == 2 or self._closed or process.poll() != 0:
                    raise
                self._end()
        raise AssertionError("one of two attempts returns or raises")

    def _running(self) -> subprocess.Popen[bytes]:
        with self._lock:
            if self._closed:
                raise MessageError("the daemon is on its way out")
            if self._process is not None and self._process.poll() is not None:
                _close_pipes(self._process)
                self._process = None
            if self._process is None:
                self._process = self._start()
            return self._process

    def _start(self) -> subprocess.Popen[bytes]:
        limits = self._limits
        command = [sys.executable, "-m", "igrow.edge.planning.worker"]
        command += [str(os.getpid()), str(limits.idle_seconds), str(limits.memory_bytes)]
        # One thread: the other cores belong to the control cycle and to everything else.
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)

    def _end(self) -> int | None:
        """End the process; returns its exit status, None where there is none to be had."""
        # While it is being started the lock is taken; a start that hangs is not waited for.
        if not self._lock.acquire(timeout=END_SECONDS):
            return None
        try:
            process, self._process = self._process, None
        finally:
            self._lock.release()
        if process is None:
            return None
        # A process that has ended by itself keeps its own status; kill changes nothing then.
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.1)
        process.kill()
        status = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            status = process.wait(END_SECONDS)
        _close_pipes(process)
        return status


def _how(status: int | None) -> str:
    return f" (signal {-status})" if status is not None and status < 0 else ""


def _close_pipes(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()


def _descriptor(stream: IO[bytes] | None) -> int:
    assert stream is not None, "the process is always started with pipes"
    return stream.fileno()
