"""An acknowledgement becomes an event of the daemon, once, with who gave it."""

from __future__ import annotations

from igrow.edge.hand_off import HandOff
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, AcknowledgementWatch, acknowledge
from igrow.edge.state_file import StateFile


def test_each_acknowledgement_is_told_once_and_none_that_a_start_finds(tmp_path) -> None:
    path, told = tmp_path / ACKNOWLEDGED_FILE, []
    watch = AcknowledgementWatch(StateFile(path, HandOff("state files")), lambda kind, **detail: told.append(detail))
    assert acknowledge(path, ["link"], "Anna", 1.0, ["link"]) == ""
    watch.look()
    assert told == []
    assert acknowledge(path, ["sensor wind_speed"], "Bert", 2.0, ["link", "sensor wind_speed"]) == ""
    for _ in range(3):
        watch.look()
    assert told == [{"alarm": "sensor wind_speed", "by": "Bert"}]
    assert acknowledge(path, ["link"], "Bert", 3.0, ["link"]) == ""
    watch.look()
    assert told[1:] == [{"alarm": "link", "by": "Bert"}]
