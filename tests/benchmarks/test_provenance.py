"""What a stored figure says of where it comes from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from benchmarks import provenance


def git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=nobody", "-c", "user.email=nobody@example.org")
    return subprocess.run(["git", *who, *words], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with one commit, in which pages of results and a module stand."""
    for name in ("docs/results/page.md", "module.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("before\n")
    for words in (("init", "-q"), ("add", "."), ("commit", "-q", "-m", "first")):
        git(tmp_path, *words)
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    return tmp_path


def test_a_page_printed_before_does_not_change_the_commit_of_the_next_one(checkout: Path) -> None:
    (checkout / "docs" / "results" / "page.md").write_text("printed anew\n")
    (checkout / "docs" / "results" / "another.md").write_text("printed\n")
    assert provenance.commit() == git(checkout, "rev-parse", "--short", "HEAD")
    (checkout / "module.py").write_text("changed\n")
    assert provenance.commit().endswith("+")
