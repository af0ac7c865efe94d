"""The root of every error that a user can cause and is told about in one line."""

from __future__ import annotations


class IgrowError(Exception):
    """What is wrong, where, and what would be right: shown as one line, never as a traceback."""


def first_line(error: Exception) -> str:
    """Return the first line of what an error says, or its kind where it says nothing."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
