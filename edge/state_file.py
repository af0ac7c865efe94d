"""Small JSON files that survive a restart: written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from igrow.core.whole_files import write_whole


def read_state(path: Path) -> dict[str, object]:
    """Return what the file holds; an empty mapping when it is absent or is no JSON object.

    A broken state file is as good as none: what it holds (leases, holds) is safe to forget.
    """
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def write_state(path: Path, content: Mapping[str, object]) -> str:
    """Replace the file atomically; return an empty text, or one line that says why it could not be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(content, indent=1, sort_keys=True).encode())
    except OSError as error:
        return f"{path}: {error.strerror or error}"
    return ""
