"""The root of every error that a user can cause and is told about in one line."""

from __future__ import annotations


class IgrowError(Exception):
    """What is wrong, where, and what would be right: shown as one line, never as a traceback."""
