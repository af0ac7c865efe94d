"""The process that does tasks, one after the other: `python -m igrow.trainer.fleet.child MEGABYTES`.

It reads a task a line and answers with a line. What a task prints goes to standard error. When whoever started it is
gone, its input ends, and so does it.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import sys
import time
import traceback
from typing import Any

from igrow.core.errors import IgrowError


def main() -> int:
    """Do the tasks on standard input."""
    limit = int(sys.argv[1]) * 2**20
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        answers.write(json.dumps(_do(json.loads(line), limit)) + "\n")
        answers.flush()
    return 0


def _do(task: dict[str, Any], limit: int) -> dict[str, Any]:
    began = time.process_time()
    try:
        module, _, name = str(task["function"]).partition(":")
        result = getattr(importlib.import_module(module), name)(**task["arguments"])
        answer: dict[str, Any] = {"result": result}
    except MemoryError:
        answer = {"note": f"it needs more memory than its limit of {limit >> 20} MB", "spent": True}
    except IgrowError as error:
        answer = {"note": str(error)}
    except OSError as error:
        answer = {"note": f"{error.filename}: {error.strerror}" if error.filename else str(error)}
    except Exception as error:  # a fault in one site's task is that site's
        traceback.print_exc()
        answer = {"note": f"a fault of this program: {type(error).__name__}: {(str(error).splitlines() or [''])[0]}"}
    answer["processor"] = time.process_time() - began
    answer["megabytes"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return answer


if __name__ == "__main__":
    sys.exit(main())
