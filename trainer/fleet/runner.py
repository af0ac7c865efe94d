"""Has tasks done: by child processes of this machine (joblib keeps them busy), or on a Ray cluster, with equal results.

Tasks know nothing of each other and each may be done again, so whatever is cut off is simply run again: a worker that
is killed costs a retry of its task, a run that is killed costs the tasks that had not ended.
"""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import urlsplit

from joblib import Parallel, delayed

from igrow.core.errors import IgrowError, first_line
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.tasks import Task, TaskOutcome
from igrow.trainer.fleet.worker import close_all, run_limited
from igrow.trainer.given import installed

ANSWERS_SECONDS = 20.0
"""Within which the head of a cluster takes a connection."""


def run_tasks(
    tasks: Sequence[Task], backend: Backend = Backend.PROCESSES, *, workers: int = 1, address: str | None = None
) -> Iterator[TaskOutcome]:
    """Yield the outcome of each task as it ends.

    Args:
        tasks: what is to be done, in any order.
        backend: where.
        workers: how many at once on this machine; a cluster has its own number.
        address: of the Ray cluster; None starts one on this machine with as many workers.

    Raises IgrowError where the cluster cannot be used.
    """
    if backend is Backend.RAY:
        yield from _on_ray(tasks, workers, address)
        return
    try:
        # Threads here only wait, each for the child process that works for it.
        parallel = Parallel(n_jobs=workers, backend="threading", return_as="generator_unordered")
        yield from parallel(delayed(run_limited)(task) for task in tasks)
    finally:
        close_all()


def _on_ray(tasks: Sequence[Task], workers: int, address: str | None) -> Iterator[TaskOutcome]:
    ray = installed("ray", "ray", "`backend: ray`")
    began = not ray.is_initialized()
    if began:
        _connect(ray, workers, address)
    try:
        # A worker that dies takes no task with it: the cluster gives the task to another.
        remote = ray.remote(num_cpus=1, max_retries=3)(run_limited)
        waiting = [remote.remote(task) for task in tasks]
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1)
            yield ray.get(ready[0])
    except ray.exceptions.RayError as error:
        raise IgrowError(f"the Ray cluster: {first_line(error)}") from None
    finally:
        if began:
            ray.shutdown()


def _connect(ray: Any, workers: int, address: str | None) -> None:
    """Join the cluster at `address`, or start one on this machine; raises IgrowError."""
    given = address or ""
    parts = urlsplit(given if "://" in given else f"ray://{given}")
    if parts.hostname and parts.port:
        try:
            # Asked first, since Ray itself waits for minutes where nobody answers.
            socket.create_connection((parts.hostname, parts.port), timeout=ANSWERS_SECONDS).close()
        except OSError as error:
            raise IgrowError(f"no Ray cluster at {address}: {error}") from None
    local = {"num_cpus": workers, "include_dashboard": False} if address is None else {}
    try:
        ray.init(address=address, log_to_driver=False, configure_logging=False, **local)
    except Exception as error:  # whatever it is, Ray raises it as a bare Exception too
        ray.shutdown()
        where = "Ray does not start on this machine" if address is None else f"no Ray cluster at {address}"
        raise IgrowError(f"{where}: {first_line(error)}") from None
