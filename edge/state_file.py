"""Small JSON files that survive a restart: written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path


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
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("w", encoding="utf-8") as file:
            json.dump(content, file, indent=1, sort_keys=True)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        return f"{path}: {error.strerror or error}"
    return ""
