"""How much an alarm matters, in three levels that people can set their telephones by."""

from __future__ import annotations

from enum import StrEnum


class Level(StrEnum):
    """What an alarm asks of people; ordered by `rank`."""

    NOTICE = "notice"
    """Know of it: control goes on as it should."""
    WARNING = "warning"
    """Look at it today: control goes on with less."""
    CRITICAL = "critical"
    """Go there now: the crop is in danger, or the plant is not controlled."""

    @property
    def rank(self) -> int:
        """0 for the least."""
        return list(Level).index(self)


_BY_KIND = {
    "link": Level.CRITICAL,
    "registers": Level.CRITICAL,
    "heartbeat": Level.CRITICAL,
    "bus": Level.CRITICAL,
    "write": Level.CRITICAL,
    "daemon": Level.CRITICAL,
    "service": Level.NOTICE,
    "interlock": Level.NOTICE,
}


def usual_level(name: str) -> Level:
    """Return the level of an alarm by the first word of its name, such as `sensor` of `sensor air_co2`."""
    return _BY_KIND.get(name.partition(" ")[0], Level.WARNING)
