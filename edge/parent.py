"""Processes beside the daemon that end with it, also when it was killed and could not tell them."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

LOOK_EVERY = 0.2
"""Seconds."""


def end_with_parent(parent: int, end: Callable[[], object]) -> None:
    """Call `end` in a thread of its own as soon as the process `parent` is gone, whatever this one is at."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_EVERY)
        end()

    threading.Thread(target=watch, daemon=True, name="parent").start()
