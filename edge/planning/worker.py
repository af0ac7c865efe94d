"""The planning process: reads requests from its standard input, answers each with a plan or one line of error.

`python -m igrow.edge.planning.worker MODULE FUNCTION IDLE MEMORY` calls MODULE.FUNCTION(site, request) for each
request, ends after IDLE seconds without one, and never takes more than MEMORY bytes of data.
"""

from __future__ import annotations

import importlib
import os
import resource
import sys
import threading
import time

from igrow.core.errors import IgrowError
from igrow.edge.planning.messages import MessageError, receive, send


def main(arguments: list[str]) -> int:
    """Serve requests until the daemon is gone or has nothing to ask."""
    module, function, idle, memory = arguments
    # A plan is never urgent: the control cycle and everything else come first.
    os.nice(10)
    resource.setrlimit(resource.RLIMIT_DATA, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Whatever a library prints must not end up between two messages.
    answers = os.dup(1)
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()
    plan = getattr(importlib.import_module(module), function)
    while True:
        try:
            site, request = receive(0, float(idle))
        except MessageError:
            return 0
        try:
            answer: tuple[str, object] = ("plan", plan(site, request))
        except IgrowError as error:
            answer = ("error", str(error))
        except MemoryError:
            answer = ("error", f"the plan needs more than {int(memory) >> 20} MiB")
        except Exception as error:
            answer = ("error", f"{type(error).__name__}: {error}")
        try:
            send(answers, answer)
        except MessageError:
            return 0


def _end_with_parent(parent: int) -> None:
    """End at once when the daemon is gone, also in the middle of a plan."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
