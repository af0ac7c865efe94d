"""Which messages are due. Pure: the alarms of this moment and what was told before go in, messages come out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

from igrow.edge.alarm_levels import Level
from igrow.edge.daemon_file import NotificationSettings
from igrow.edge.notifications.message import Message

HOUR = 3600.0


@dataclass(frozen=True)
class Alarm:
    """An alarm that is active now."""

    text: str
    level: Level


@dataclass(frozen=True)
class Told:
    """An alarm that people were told of."""

    text: str
    level: Level
    at: float
    """When last, seconds since 1970 UTC."""


@dataclass(frozen=True)
class Outbox:
    """What was told so far; the state that a restart carries over."""

    told: Mapping[str, Told] = field(default_factory=dict)
    """By the alarm's name."""
    sent: tuple[float, ...] = ()
    """Times of the messages of the last hour."""

    def due(
        self,
        site: str,
        alarms: Mapping[str, Alarm],
        acknowledged: Collection[str],
        now: float,
        settings: NotificationSettings,
    ) -> tuple[Message | None, Outbox]:
        """Return the message that is due, or None, and the outbox once it has been sent.

        Everything that is due goes into one message. Where the hour's messages are used up all of it waits: nothing is
        marked as told, so it comes with the next one. An acknowledged alarm is not told again; its end is.

        Args:
            site: name of the greenhouse, for the title.
            alarms: active now, by name.
            acknowledged: names of alarms that people know of.
            now: seconds since 1970 UTC.
            settings: who is told of what.
        """
        matter = {name: alarm for name, alarm in alarms.items() if alarm.level.rank >= settings.level.rank}
        begun = {name: alarm for name, alarm in matter.items() if name not in self.told}
        repeated = {
            name: alarm
            for name, alarm in matter.items()
            if name in self.told
            and name not in acknowledged
            and now - self.told[name].at >= settings.repeat.total_seconds()
        }
        over = {name: told for name, told in self.told.items() if name not in alarms}
        shown_over = over if settings.ends else {}
        lines = [
            *(alarm.text for alarm in begun.values()),
            *(f"still: {alarm.text}" for alarm in repeated.values()),
            *(f"over: {told.text}" for told in shown_over.values()),
        ]
        recent = tuple(time for time in self.sent if now - HOUR < time <= now)
        if not lines:
            kept = {name: told for name, told in self.told.items() if name not in over}
            return None, Outbox(kept, recent)
        if len(recent) >= settings.most_per_hour:
            return None, replace(self, sent=recent)
        news = {name: Told(alarm.text, alarm.level, now) for name, alarm in {**begun, **repeated}.items()}
        kept = {name: told for name, told in self.told.items() if name not in over}
        levels = [alarm.level for alarm in (*begun.values(), *repeated.values())]
        level = max(levels, key=lambda one: one.rank, default=Level.NOTICE)
        message = Message(_title(site, len(begun) + len(repeated), len(shown_over), level), "\n".join(lines), level)
        return message, Outbox({**kept, **news}, (*recent, now))


def _title(site: str, active: int, over: int, level: Level) -> str:
    if not active:
        return f"{site}: {'an alarm is' if over == 1 else f'{over} alarms are'} over"
    word = "CRITICAL" if level is Level.CRITICAL else level.value
    return f"{site}: {word}, {'an alarm' if active == 1 else f'{active} alarms'}"
