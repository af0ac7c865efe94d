"""The section `notifications` of the daemon's file."""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from dataclasses import dataclass

from igrow.core.yaml_schema import setting
from igrow.edge.alarm_levels import Level

_MINUTE = datetime.timedelta(minutes=1)
_DAY = datetime.timedelta(days=1)


@dataclass(frozen=True)
class NotificationSettings:
    """Who is told of alarms, and how often."""

    services: tuple[str, ...] = setting(default=(), help="Apprise addresses, such as ntfys://ntfy.example/greenhouse")
    level: Level = setting(default=Level.WARNING, help="least level that is told: notice, warning or critical")
    ends: bool = setting(default=True, help="tell when an alarm is over, too")
    repeat: datetime.timedelta = setting(
        low=5 * _MINUTE, high=7 * _DAY, default=datetime.timedelta(hours=4), help="told again until acknowledged"
    )
    most_per_hour: int = setting(low=1, high=60, default=6, help="messages an hour; the rest come together later")
    silent_daemon: datetime.timedelta = setting(
        low=_MINUTE, high=_DAY, default=5 * _MINUTE, help="silence of the daemon after which that is told"
    )
