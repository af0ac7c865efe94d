"""Fixtures that every room shares."""

from __future__ import annotations

import os
from itertools import chain, islice, zip_longest
from pathlib import Path

import pytest
from hypothesis import settings

from tests import made_once, needs

# No test of this project asserts a time, on a busy machine least of all.
settings.register_profile("igrow", deadline=None)
settings.load_profile("igrow")


def pytest_configure(config: pytest.Config) -> None:
    """Begin a run, which the workers of pytest-xdist share."""
    if not hasattr(config, "workerinput"):
        made_once.begin()


def pytest_unconfigure(config: pytest.Config) -> None:
    """End it."""
    if not hasattr(config, "workerinput"):
        made_once.end()


COMPUTING = (
    "diagnosis", "fit", "fleet", "research", "recalibration", "scoring", "season", "report", "benchmarks"
)  # fmt: skip
"""Folders with tests that fit or plan for many seconds, those that take longest first."""
WAITING = ("service", "loop", "page", "hangs")
"""Folders with tests that wait for many seconds, for a daemon, a line or a clock."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let each worker begin with files of its own that take long, so that at the end none waits for one of these.

    A worker is given as many tests as any other, those that follow each other; who has done his takes over the last of
    whoever has most, however long they take. Files that compute and files that wait follow each other, so that some
    wait while others compute.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "0"))
    if not workers:
        return
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)

    def of(folders: tuple[str, ...]) -> list[list[pytest.Item]]:
        return [file for folder in folders for path, file in files.items() if path.parent.name == folder]

    pairs = zip_longest(of(COMPUTING), of(WAITING))
    long = [file for pair in pairs for file in pair if file is not None]
    others = chain.from_iterable(file for path, file in files.items() if path.parent.name not in (*COMPUTING, *WAITING))
    ordered: list[pytest.Item] = []
    for worker in range(workers):
        share = list(chain.from_iterable(long[worker::workers]))
        ordered += [*share, *islice(others, max(0, len(items) // workers - len(share)))]
    items[:] = [*ordered, *others]


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with the public greenhouse data sets; tests that need it skip, saying so, where it is absent."""
    return needs.data_sets()
