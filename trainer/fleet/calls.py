"""Calls of a function, each with arguments of its own, as the fleet's tasks: whoever has many goes this one way.

What a call is given and what it returns lies in files of a folder; a cluster's machines have to see it as well.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

from igrow.core.whole_files import write_whole
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task

SECONDS, MEGABYTES = 86_400.0, 16_000
"""Limits of one call."""
J = TypeVar("J")
R = TypeVar("R")


def call_each(
    function: Callable[[J], R],
    arguments: Iterable[J],
    folder: Path,
    *,
    code: bytes = b"",
    backend: Backend = Backend.PROCESSES,
    workers: int = 1,
    address: str | None = None,
) -> Iterator[R]:
    """Yield what a function of a module returns for each argument, in their order.

    Args:
        function: at the top of a module; both what it takes and what it returns can be pickled.
        arguments: one a call.
        folder: takes each result as soon as it is there; what it has already is not done again.
        code: a digest of what the results depend on beside the arguments; results of another one do not count.
        backend, workers, address: as of `run_tasks`.

    Raises:
        RuntimeError: some calls failed, after all others are done and kept.
    """
    files = [_asked(function, one, folder, code) for one in arguments]
    tasks = [
        Task(str(number), f"{__name__}:do", {"file": str(file)}, SECONDS, MEGABYTES)
        for number, file in enumerate(files)
        if not _result(file).exists()
    ]
    failed: list[str] = []
    outcomes = run_tasks(tasks, backend, workers=workers, address=address) if tasks else iter(())
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


def do(file: str) -> dict[str, str]:
    """Make a call, in a worker."""
    function, argument = pickle.loads(Path(file).read_bytes())
    write_whole(_result(Path(file)), pickle.dumps(function(argument)))
    return {}


def _asked(function: Callable[[J], R], argument: J, folder: Path, code: bytes) -> Path:
    content = pickle.dumps((function, argument))
    file = folder / f"{hashlib.sha256(code + content).hexdigest()[:32]}.job"
    if not _result(file).exists():
        write_whole(file, content)
    return file


def _result(file: Path) -> Path:
    return file.with_suffix(".result")
