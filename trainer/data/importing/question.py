"""What a file cannot tell, what the user may say instead, and with which option."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Answers:
    """What the user said."""

    time_zone: str | None = None
    date_order: str | None = None
    """``dmy``, ``mdy`` or ``ymd``."""
    compartment: str | None = None
    sheet: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    """Quantity -> column."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Quantity -> unit."""


@dataclass(frozen=True)
class Question:
    """Something that only the user knows."""

    about: str
    """Field of `Answers`, or ``columns:QUANTITY``, ``units:QUANTITY``."""
    text: str
    choices: tuple[str, ...]
    option: str
    """That answers it, as it is typed."""
    blocks: bool = False
    """No mapping is written while it is open: every guess could be wrong without anybody seeing it."""
