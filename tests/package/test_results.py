"""Pages of results say where they come from: a command, and a commit that anybody can check out."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from benchmarks.provenance import ROOT
from benchmarks.results import FOLDER

PAGES = sorted(page for page in FOLDER.glob("*.md") if page.name != "README.md")
SOURCE = re.compile(r"^\| `python -m [^`]+` \| \d{4}-\d\d-\d\d \| ([0-9a-f]{7,40})\+? \|", re.MULTILINE)


def git(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module", autouse=True)
def history() -> None:
    """Need every commit of the repository, which a shallow clone and an archive of it have not."""
    if git("rev-parse", "--is-shallow-repository").stdout.strip() != "false":
        pytest.skip("the repository's history is not here, so this was not tested: `git fetch --unshallow`")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_names_a_commit_of_this_history(page: Path) -> None:
    """A commit that was rebased after it had printed a page is nowhere: print pages from what is on the main branch."""
    (commit,) = SOURCE.findall(page.read_text(encoding="utf-8"))
    assert git("merge-base", "--is-ancestor", commit, "HEAD").returncode == 0, f"{commit} is no commit of this history"
