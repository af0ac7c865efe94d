"""Where a stored figure comes from: the command, its date, the commit, its seeds."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGES = ":(exclude)docs/results"


def provenance(command: str, seeds: Mapping[str, object] | int | None = None) -> dict[str, Any]:
    """Return what a reader needs to make a figure again."""
    return {"command": command, "date": f"{datetime.now(UTC):%Y-%m-%d}", "commit": commit(), "seeds": seeds}


def commit() -> str:
    """Return the short name of the commit, with a plus sign where files have changed since; empty outside of git.

    The pages of results are what is being written: one that was printed before changes nothing of the next.
    """
    name, changed = _git("rev-parse", "--short", "HEAD"), _git("diff", "--name-only", "HEAD", "--", ".", PAGES)
    return name + "+" * bool(changed)


def _git(*words: str) -> str:
    try:
        asked = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return asked.stdout.strip()
