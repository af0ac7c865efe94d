"""Which messages are due: each alarm once, again until acknowledged, never more than the hour allows, none lost."""

from __future__ import annotations

import datetime

from igrow.edge.alarm_levels import Level
from igrow.edge.daemon_file import NotificationSettings
from igrow.edge.notifications.outbox import Alarm, Outbox

SETTINGS = NotificationSettings()
COLD = {"climate too_cold": Alarm("too cold: now 9.5", Level.CRITICAL)}
WIND = {"sensor wind_speed": Alarm("wind_speed is frozen", Level.WARNING)}


def due(outbox, alarms, now, acknowledged=(), settings=SETTINGS):
    return outbox.due("hillside", alarms, acknowledged, now, settings)


def test_an_alarm_is_told_once_and_its_end_once():
    message, outbox = due(Outbox(), COLD, 0.0)
    assert (message.title, message.body, message.level) == (
        "hillside: CRITICAL, an alarm", "too cold: now 9.5", Level.CRITICAL,
    )  # fmt: skip
    message, outbox = due(outbox, COLD, 60.0)
    assert message is None
    message, outbox = due(outbox, {}, 120.0)
    assert (message.title, message.body) == ("hillside: an alarm is over", "over: too cold: now 9.5")
    assert due(outbox, {}, 180.0)[0] is None


def test_an_alarm_that_stays_is_told_again_until_somebody_knows_of_it():
    _, outbox = due(Outbox(), COLD, 0.0)
    message, again = due(outbox, COLD, 4 * 3600.0)
    assert message.body == "still: too cold: now 9.5"
    assert due(again, COLD, 8 * 3600.0 - 1)[0] is None
    assert due(outbox, COLD, 4 * 3600.0, acknowledged=["climate too_cold"])[0] is None


def test_the_end_of_an_acknowledged_alarm_is_told():
    _, outbox = due(Outbox(), COLD, 0.0)
    assert due(outbox, {}, 60.0, acknowledged=["climate too_cold"])[0].body.startswith("over:")


def test_what_comes_together_is_one_message_of_the_highest_level():
    message, _ = due(Outbox(), {**WIND, **COLD}, 0.0)
    assert message.title == "hillside: CRITICAL, 2 alarms"
    assert message.body.splitlines() == ["wind_speed is frozen", "too cold: now 9.5"]


def test_levels_below_the_sites_own_are_not_told():
    notice = {"service exchange": Alarm("exchange failed", Level.NOTICE)}
    assert due(Outbox(), notice, 0.0)[0] is None
    assert due(Outbox(), notice, 0.0, settings=NotificationSettings(level=Level.NOTICE))[0] is not None


def test_a_flapping_alarm_costs_no_more_than_the_hours_messages_and_nothing_is_lost():
    outbox, sent = Outbox(), []
    for second in range(0, 3600, 10):
        message, outbox = due(outbox, WIND if second % 20 == 0 else {}, float(second))
        sent += [message] if message else []
    assert len(sent) == SETTINGS.most_per_hour
    message, outbox = due(outbox, {**WIND, **COLD}, 3600.0)
    assert "too cold: now 9.5" in message.body


def test_a_critical_alarm_that_had_to_wait_comes_when_there_is_room():
    settings = NotificationSettings(most_per_hour=1)
    _, outbox = due(Outbox(), WIND, 0.0, settings=settings)
    message, outbox = due(outbox, {**WIND, **COLD}, 60.0, settings=settings)
    assert message is None
    message, outbox = due(outbox, {**WIND, **COLD}, 3601.0, settings=settings)
    assert message.body == "too cold: now 9.5"


def test_ends_are_kept_quiet_where_nobody_wants_them():
    settings = NotificationSettings(ends=False)
    _, outbox = due(Outbox(), COLD, 0.0, settings=settings)
    message, outbox = due(outbox, {}, 60.0, settings=settings)
    assert message is None
    assert due(outbox, COLD, 120.0, settings=settings)[0] is not None


def test_a_clock_that_was_set_back_does_not_silence_anything():
    settings = NotificationSettings(repeat=datetime.timedelta(minutes=5))
    _, outbox = due(Outbox(), WIND, 1e9, settings=settings)
    message, _ = due(outbox, {**WIND, **COLD}, 1e6, settings=settings)
    assert "too cold" in message.body
