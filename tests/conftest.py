"""Fixtures that every room shares."""

from __future__ import annotations

import os
from itertools import chain, islice
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


LONG = {
    "benchmarks", "diagnosis", "fit", "fleet", "hangs", "loop", "page", "recalibration", "report", "research",
    "scoring", "season", "service",
}  # fmt: skip
"""Folders with tests that fit, plan or wait for many seconds."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let each worker begin with files of its own that take long, so that at the end none waits for one of these.

    A worker is given as many tests as any other, those that follow each other; who has done his takes over the last of
    whoever has most, however long they take.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "0"))
    if not workers:
        return
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    long = [file for path, file in files.items() if path.parent.name in LONG]
    others = chain.from_iterable(file for path, file in files.items() if path.parent.name not in LONG)
    ordered: list[pytest.Item] = []
    for worker in range(workers):
        share = list(chain.from_iterable(long[worker::workers]))
        ordered += [*share, *islice(others, max(0, len(items) // workers - len(share)))]
    items[:] = [*ordered, *others]


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with the public greenhouse data sets; tests that need it skip, saying so, where it is absent."""
    return needs.data_sets()
