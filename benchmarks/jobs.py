"""A command's list of independent jobs, by the fleet's tasks: child processes of this machine or Ray, and resumable.

    with Jobs("diagnosis scoring", processes=2) as jobs:
        for outcome in jobs.each(judge, cases):
            ...

Each job's result is kept as soon as it is there. A command that was cut short and is started again does what was not
done yet; one that ends well forgets what it kept. What was kept by other code, or other jobs, does not count.

`IGROW_BENCHMARKS_RAY` names an existing cluster (`ray://head:10001`), whose machines see this folder under the same
path and have igrow installed; `local` starts one on this machine. The digits are the same.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from benchmarks.provenance import ROOT
from igrow.trainer.fleet.calls import call_each
from igrow.trainer.fleet.registry import Backend

KEPT = ROOT / "out" / "benchmarks"
CLUSTER = "IGROW_BENCHMARKS_RAY"
J = TypeVar("J")
R = TypeVar("R")


class Jobs:
    """The jobs of one command."""

    def __init__(self, command: str, processes: int, kept: Path = KEPT) -> None:
        self.folder = kept / command.replace(" ", "-")
        self.processes = processes
        self.cluster = os.environ.get(CLUSTER, "")

    def __enter__(self) -> Jobs:
        self.folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            shutil.rmtree(self.folder)

    def each(self, function: Callable[[J], R], jobs: Iterable[J]) -> Iterator[R]:
        """Yield the result of a function of a module for each job, in the order of the jobs.

        Raises:
            IgrowError: the cluster cannot be used.
            RuntimeError: some of them failed, after all others are done and kept.
        """
        backend = Backend.RAY if self.cluster else Backend.PROCESSES
        address = None if self.cluster in ("", "local") else self.cluster
        yield from call_each(
            function, jobs, self.folder, code=_code(), backend=backend, workers=self.processes, address=address
        )


@cache
def _code() -> bytes:
    """Return a digest of everything that a result may depend on."""
    digest = hashlib.sha256(sys.version.encode())
    for folder in ("igrow_core", "trainer", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".json", ".npz", ".onnx", ".yaml"}:
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.digest()
