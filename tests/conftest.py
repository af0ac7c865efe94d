"""Fixtures that every room shares."""

from __future__ import annotations

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


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with the public greenhouse data sets; tests that need it skip, saying so, where it is absent."""
    return needs.data_sets()
