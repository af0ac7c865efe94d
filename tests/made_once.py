"""What takes long to make and is the same whoever asks: made once in a run of the tests, by whoever asks first."""

from __future__ import annotations

import fcntl
import functools
import hashlib
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

from igrow.core.whole_files import write_whole

P = ParamSpec("P")
R = TypeVar("R")
FOLDER = "IGROW_TESTS_MADE_ONCE"
"""Environment variable with the folder of the run; the processes that pytest-xdist starts inherit it."""


def begin() -> None:
    """Make the folder of a run; called in the process that starts the others."""
    os.environ[FOLDER] = tempfile.mkdtemp(prefix="igrow-made-once-")


def end() -> None:
    """Forget all that was made."""
    shutil.rmtree(os.environ.pop(FOLDER), ignore_errors=True)


def made_once(make: Callable[P, R]) -> Callable[P, R]:
    """Return the function, which a run calls once for the same arguments; each caller gets a copy of its own.

    Both what it takes and what it returns can be pickled, and it returns the same for the same arguments.
    """

    @functools.wraps(make)
    def made(*args: P.args, **kwargs: P.kwargs) -> R:
        asked = pickle.dumps((make.__module__, make.__qualname__, args, kwargs))
        file = Path(os.environ[FOLDER], hashlib.sha256(asked).hexdigest())
        with file.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not file.exists():
                write_whole(file, pickle.dumps(make(*args, **kwargs)))
        result: R = pickle.loads(file.read_bytes())
        return result

    return made
