"""A task and its outcome: what travels between the fleet, its workers and a cluster. Both are plain JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any


class Ending(Enum):
    """How a task ended."""

    DONE = "done"
    FAILED = "failed"
    """It said itself what is wrong; trying again at once changes nothing."""
    KILLED = "killed"
    """Its process ended, from outside or for want of memory."""
    LATE = "late"
    """It took longer than its limit."""


@dataclass(frozen=True)
class Task:
    """One piece of work that depends on no other; doing it twice does no harm."""

    name: str
    """Of the site."""
    function: str
    """`module:function`; it takes the arguments by name and returns what JSON can hold."""
    arguments: Mapping[str, Any]
    seconds: float = 1800.0
    megabytes: int = 4000
    retries: int = 2


@dataclass(frozen=True)
class TaskOutcome:
    """What became of a task."""

    name: str
    ending: Ending
    result: Mapping[str, Any]
    """What the function returned; empty unless it is done."""
    note: str = ""
    """One sentence on what went wrong."""
    seconds: float = 0.0
    processor: float = 0.0
    """Seconds of processor that it used, which other work on the machine does not change."""
    megabytes: float = 0.0
    """Largest resident memory of the process that did it."""
    attempts: int = 1
