"""How long work tells its caller what it is doing: step by step, in lines."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]
"""Is told of each step."""


def silent(step: str) -> None:
    """Tell nobody."""
