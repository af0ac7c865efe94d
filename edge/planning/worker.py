"""The planning process: reads calls from its standard input, answers each with a result or one error.

`python -m igrow.edge.planning.worker PARENT IDLE MEMORY` imports the function that a call names and calls it, ends
after IDLE seconds without a call or when the process PARENT is gone, and never takes more than MEMORY bytes of data.
"""

from __future__ import annotations

import contextlib
import importlib
import math
import os
import pickle
import resource
import sys
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.parent import end_with_parent
from igrow.edge.planning.messages import MessageError, receive, send

ANSWER_SECONDS = 60.0
"""Longest time that the daemon may take to fetch an answer."""


def main(arguments: list[str]) -> int:
    """Serve calls until the daemon is gone or has nothing to ask."""
    parent, idle, memory = int(arguments[0]), float(arguments[1]), int(arguments[2])
    end_with_parent(parent, lambda: os._exit(0))
    _give_way(memory)
    # Whatever a library prints must not end up between two messages.
    answers = os.dup(1)
    os.dup2(2, 1)
    while True:
        try:
            function, given, seconds = receive(0, idle)
        except MessageError:
            return 0
        try:
            send(answers, _answer(function, given, seconds, memory), ANSWER_SECONDS)
        except MessageError:
            return 0


def _answer(function: str, given: tuple[object, ...], seconds: float, memory: int) -> tuple[str, object]:
    _bound_processor(seconds)
    try:
        module, name = function.split(":")
        return "done", getattr(importlib.import_module(module), name)(*given)
    except IgrowError as error:
        return "raised", _portable(error)
    except MemoryError:
        return "failed", f"it needs more than {memory >> 20} MiB"
    except Exception as error:
        return "failed", f"{type(error).__name__}: {error}"


def _portable(error: IgrowError) -> IgrowError:
    """Return the error, or its text as a plain one where it does not survive the way."""
    try:
        copy = pickle.loads(pickle.dumps(error))
    except Exception:
        return IgrowError(str(error))
    return error if isinstance(copy, IgrowError) else IgrowError(str(error))


def _give_way(memory: int) -> None:
    """Come last for processor and memory: the control cycle and everything else come first."""
    os.nice(10)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):
        # Where the machine's memory runs out in spite of that, this process goes, and not the daemon.
        Path("/proc/self/oom_score_adj").write_text("1000")


def _bound_processor(seconds: float) -> None:
    """Let the kernel end this process when one call takes more processor time than it may take at all.

    The daemon ends it by the wall's clock; this holds while the daemon is stopped or busy with its own end.
    """
    usage = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(usage.ru_utime + usage.ru_stime + seconds) + 1, hard))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
