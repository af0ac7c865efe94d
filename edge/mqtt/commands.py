"""What a message from a broker may do: override one setpoint for some time, not more often than people do."""

from __future__ import annotations

import math

from igrow.core.errors import IgrowError
from igrow.core.quantities import with_unit
from igrow.edge.configuration import Configuration
from igrow.edge.overriding import override

LONGEST_PAYLOAD = 32
LEAST_SECONDS = 5.0
"""Between two overrides of one setpoint."""


class Commands:
    """Takes messages, however many and whatever they hold."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._last: dict[str, float] = {}

    def take(self, setpoint: str, payload: bytes, monotonic: float) -> str:
        """Do what a message asks for; returns one line that says what was done, or why not."""
        settings = self._configuration.file.mqtt
        if not settings.permit_override:
            return "a message asked for an override, which mqtt.permit_override does not allow"
        try:
            if len(payload) > LONGEST_PAYLOAD:
                raise ValueError
            value = float(payload)
        except ValueError:
            return f"{setpoint[:40]!r}: the message holds no number"
        if not math.isfinite(value):
            return f"{setpoint[:40]!r}: {value} is no setpoint"
        if monotonic - self._last.get(setpoint, -math.inf) < LEAST_SECONDS:
            return f"{setpoint[:40]!r}: another message came less than {LEAST_SECONDS:.0f} s ago"
        try:
            override(self._configuration, {setpoint: value}, settings.override_for.total_seconds(), by="MQTT")
        except IgrowError as error:
            return str(error)
        self._last[setpoint] = monotonic
        return f"{setpoint} overridden to {with_unit(setpoint, value)} by a message"
