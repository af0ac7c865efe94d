"""A worker: a child process with a limit of memory, ended when a task takes too long, and replaced when it is gone."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

from igrow.trainer.fleet.tasks import Ending, Task, TaskOutcome

MOST_TASKS = 200
"""After which a child is replaced, so that what libraries leave behind does not pile up."""
_local = threading.local()
_all: list[Worker] = []


class Worker:
    """Runs tasks in a child process, one after the other."""

    def __init__(self, megabytes: int) -> None:
        self.megabytes = megabytes
        self.done = 0
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "igrow.trainer.fleet.child", str(megabytes)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            start_new_session=True,
        )

    def run(self, task: Task) -> TaskOutcome:
        """Do one task; after anything but DONE or FAILED this worker is of no more use."""
        began = time.monotonic()
        request = {"function": task.function, "arguments": dict(task.arguments)}
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            return self._lost(task, began)
        line = self._answer(began + task.seconds)
        seconds = time.monotonic() - began
        if line is None:
            self.close()
            note = f"not done after {task.seconds:g} s, its limit"
            return TaskOutcome(task.name, Ending.LATE, {}, note, seconds)
        if not line.endswith(b"\n"):
            return self._lost(task, began)
        self.done += 1
        answer = json.loads(line)
        if answer.get("spent"):
            self.done = MOST_TASKS
        used = {"seconds": seconds, "processor": answer["processor"], "megabytes": answer["megabytes"]}
        if "result" in answer:
            return TaskOutcome(task.name, Ending.DONE, answer["result"], **used)
        return TaskOutcome(task.name, Ending.FAILED, {}, answer["note"], **used)

    def close(self) -> None:
        """End the child, with all that it started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()

    def _answer(self, until: float) -> bytes | None:
        """Return the next line, a part of one where the child ended, None where the time is over."""
        assert self._process.stdout is not None
        descriptor, line = self._process.stdout.fileno(), b""
        while not line.endswith(b"\n"):
            ready, _, _ = select.select([descriptor], [], [], max(0.0, until - time.monotonic()))
            if not ready:
                return None
            chunk = os.read(descriptor, 65_536)
            if not chunk:
                return line
            line += chunk
        return line

    def _lost(self, task: Task, began: float) -> TaskOutcome:
        self.close()
        code = self._process.returncode
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        note = f"its process ended ({how}); out of memory, or ended from outside"
        return TaskOutcome(task.name, Ending.KILLED, {}, note, time.monotonic() - began)


def run_limited(task: Task) -> TaskOutcome:
    """Do a task in this thread's worker, and again where the worker was lost, as often as the task allows."""
    for attempt in range(1, task.retries + 2):
        worker = getattr(_local, "worker", None)
        if worker is None or worker.done >= MOST_TASKS or worker.megabytes != task.megabytes:
            if worker is not None:
                worker.close()
            worker = _local.worker = Worker(task.megabytes)
            _all.append(worker)
        outcome = worker.run(task)
        if outcome.ending in (Ending.KILLED, Ending.LATE):
            _local.worker = None
        if outcome.ending is not Ending.KILLED or attempt > task.retries:
            break
    return replace(outcome, attempts=attempt)


def close_all() -> None:
    """End the workers of all threads of this process; the next task starts another."""
    while _all:
        _all.pop().close()
    _local.worker = None
