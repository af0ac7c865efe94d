"""What several commands share."""

from __future__ import annotations

import argparse
import datetime
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration, load_configuration

DEFAULT_CONFIGURATION = Path("/etc/igrow/daemon.yaml")

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "day": 86_400.0, "days": 86_400.0}


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """Add the daemon's file as the command's argument."""
    parser.add_argument(
        "configuration",
        type=Path,
        nargs="?",
        default=DEFAULT_CONFIGURATION,
        help=f"the daemon's YAML file (default: {DEFAULT_CONFIGURATION})",
    )


def configuration_of(options: argparse.Namespace) -> Configuration:
    """Load the daemon's configuration; raises IgrowError."""
    return load_configuration(options.configuration)


def parse_duration(text: str) -> float:
    """Return the seconds of a text such as `30 min`, `2h` or `90 s`; raises IgrowError."""
    stripped = text.strip()
    number = stripped.rstrip("abcdefghijklmnopqrstuvwxyz ")
    unit = stripped[len(number) :].strip()
    try:
        seconds = float(number) * _UNITS[unit]
    except (KeyError, ValueError):
        raise IgrowError(f"{text!r} is no duration: 90 s, 30 min, 2 h or 1 day is right") from None
    if not 0 < seconds < 366 * 86_400:
        raise IgrowError(f"{text!r}: a duration must be positive and under a year")
    return seconds


def parse_time(text: str) -> float:
    """Return the seconds since 1970 of a UTC date or time in ISO 8601; raises IgrowError."""
    try:
        moment = datetime.datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        raise IgrowError(f"{text!r} is no time: 2026-03-14 or 2026-03-14T06:00:00Z is right") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=datetime.UTC)
    return moment.timestamp()


def parse_setpoint(text: str) -> tuple[str, float]:
    """Return name and value of a text such as `heating_setpoint=18`; raises IgrowError."""
    name, separator, number = text.partition("=")
    try:
        return name.strip(), float(number) if separator else float("")
    except ValueError:
        raise IgrowError(f"{text!r}: SETPOINT=VALUE is right, such as heating_setpoint=18") from None
