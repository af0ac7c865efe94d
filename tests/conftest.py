"""Fixtures that every room shares."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# No test of this project asserts a time, on a busy machine least of all.
settings.register_profile("igrow", deadline=None)
settings.load_profile("igrow")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder with the public greenhouse data sets; tests that need it skip, saying so, where it is absent."""
    folder = Path(os.environ.get("IGROW_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no greenhouse data in {folder}; set IGROW_DATA to the folder that holds agc2019 and the others")
    return folder
