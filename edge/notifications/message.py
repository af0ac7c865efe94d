"""What is sent. Alone in its module: the process that sends has little memory, and imports little."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.edge.alarm_levels import Level


@dataclass(frozen=True)
class Message:
    """What is sent, once, to every service."""

    title: str
    body: str
    level: Level
