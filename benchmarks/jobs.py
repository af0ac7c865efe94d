"""A command's list of independent jobs, by the fleet's tasks: child processes of this machine, and resumable.

    with Jobs("diagnosis scoring", processes=2) as jobs:
        for outcome in jobs.each(judge, cases):
            ...

Each job's result is kept as soon as it is there. A command that was cut short and is started again does what was not
done yet; one that ends well forgets what it kept. What was kept by other code, or other jobs, does not count.
"""

from __future__ import annotations

import hashlib
import pickle
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from benchmarks.provenance import ROOT
from igrow.core.whole_files import write_whole
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task

KEPT = ROOT / "out" / "benchmarks"
SECONDS, MEGABYTES = 86_400.0, 16_000
"""Limits of one job."""
J = TypeVar("J")
R = TypeVar("R")


class Jobs:
    """The jobs of one command."""

    def __init__(self, command: str, processes: int, kept: Path = KEPT) -> None:
        self.folder = kept / command.replace(" ", "-")
        self.processes = processes

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
            RuntimeError: some of them failed, after all others are done and kept.
        """
        files = [self._asked(function, job) for job in jobs]
        tasks = [
            Task(str(number), "benchmarks.jobs:do", {"file": str(file)}, SECONDS, MEGABYTES)
            for number, file in enumerate(files)
            if not _result(file).exists()
        ]
        failed: list[str] = []
        outcomes = run_tasks(tasks, workers=self.processes) if tasks else iter(())
        for file in files:
            while not failed and not _result(file).exists():
                outcome = next(outcomes)
                failed += [outcome.note] * (outcome.ending is not Ending.DONE)
            if not failed:
                yield pickle.loads(_result(file).read_bytes())
        failed += [one.note for one in outcomes if one.ending is not Ending.DONE]
        if failed:
            raise RuntimeError(
                f"{len(failed)} of {len(files)} jobs failed, the others are kept: {failed[0]}; start it again"
            )

    def _asked(self, function: Callable[[J], R], job: J) -> Path:
        content = pickle.dumps((function, job))
        digest = hashlib.sha256(_code() + content).hexdigest()[:32]
        file = self.folder / f"{digest}.job"
        if not _result(file).exists():
            write_whole(file, content)
        return file


def do(file: str) -> dict[str, str]:
    """Do a job in a child process."""
    function, job = pickle.loads(Path(file).read_bytes())
    write_whole(_result(Path(file)), pickle.dumps(function(job)))
    return {}


def _result(file: Path) -> Path:
    return file.with_suffix(".result")


@cache
def _code() -> bytes:
    """Return a digest of everything that a result may depend on."""
    digest = hashlib.sha256(sys.version.encode())
    for folder in ("igrow_core", "trainer", "benchmarks"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".json", ".npz", ".onnx", ".yaml"}:
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.digest()
