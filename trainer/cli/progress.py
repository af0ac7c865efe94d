"""Progress of work that takes more than a moment: at a terminal a line that moves, elsewhere nothing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from tqdm import tqdm

from igrow.trainer.progress import Progress

_SECOND = 1.0


@contextmanager
def progress(title: str) -> Iterator[Progress]:
    """Yield what is told of each step of a work; the line shows the step and the time since the work began."""
    # `disable=None` is tqdm's own way to be quiet where standard error is no terminal.
    with tqdm(desc=title, bar_format="{desc} [{elapsed}]", leave=False, disable=None) as line:
        done = threading.Event()

        def tick() -> None:
            while not done.wait(_SECOND):
                line.refresh()

        clock = threading.Thread(target=tick, daemon=True)
        if not line.disable:
            clock.start()
        try:
            yield lambda step: line.set_description_str(f"{title}: {step}")
        finally:
            done.set()
            if clock.ident is not None:
                clock.join()


@contextmanager
def days_done(title: str, start: np.datetime64, end: np.datetime64) -> Iterator[Callable[[np.datetime64], None]]:
    """Yield what is told of each time that a simulation has reached; the bar counts the days."""
    days = float((end - start) / np.timedelta64(1, "D"))
    with tqdm(
        total=round(days),
        desc=title,
        unit="day",
        leave=False,
        disable=None,
        bar_format="{l_bar}{bar}| {n:.0f}/{total} {unit}s [{elapsed}<{remaining}]",
    ) as bar:

        def reached(time: np.datetime64) -> None:
            bar.update(max(0.0, float((time - start) / np.timedelta64(1, "D")) - bar.n))

        yield reached
        bar.refresh()
