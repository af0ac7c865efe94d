"""How fast a virtual PLC's plant runs."""

from __future__ import annotations

from dataclasses import dataclass

from igrow.core.errors import IgrowError


@dataclass(frozen=True)
class Realtime:
    """One plant second a second, or `speed` of them."""

    speed: float = 1.0


@dataclass(frozen=True)
class Lockstep:
    """The plant advances by `interval` seconds each time the controller changes the heartbeat register.

    The step is done before the heartbeat's write is confirmed: a controller that has its confirmation reads the
    new state, and a season is as fast as the controller and the same each time.
    """

    interval: float = 300.0


Pace = Realtime | Lockstep


def parse_pace(text: str) -> Pace:
    """Return the pace written as `realtime`, `speed=60`, `lockstep` or `lockstep=300` (seconds a step)."""
    word, separator, number = text.partition("=")
    try:
        value = float(number) if separator else None
    except ValueError:
        value = -1.0
    if value is None or 0 < value < float("inf"):
        if word == "realtime" and value is None:
            return Realtime()
        if word == "speed" and value is not None:
            return Realtime(value)
        if word == "lockstep":
            return Lockstep() if value is None else Lockstep(value)
    raise IgrowError(f"pace {text!r}: realtime, speed=N (N > 0), lockstep or lockstep=SECONDS is right")
