"""What journald gets: one line for each thing that happens, with its priority, in words."""

from __future__ import annotations

import re
import signal
from pathlib import Path

import pytest

from igrow.edge.sentences import SENTENCES, sentence
from tests.service.running_daemon import RunningDaemon


def test_every_line_of_the_journal_has_a_priority_and_no_line_is_a_programmers(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path)
    try:
        plant.start(JOURNAL_STREAM="8:1")
        plant.wait_for((plant.state / "status.json").exists)
        plant.plc.kill()
        plant.wait_for(lambda: "<4>" in (tmp_path / "daemon.log").read_text())
        assert plant.stop() == 0
    finally:
        plant.close()
    lines = (tmp_path / "daemon.log").read_text().splitlines()
    assert all(re.match(r"<[2-6]>\S", line) for line in lines), lines
    assert any(line.startswith("<6>started for site ") for line in lines)
    assert any(line.startswith("<4>") and "the line was lost" in line for line in lines)
    assert any(line.startswith("<6>recipe decides, before it none: ") for line in lines)
    assert lines[-1].startswith("<6>stopped: nothing was written")
    assert not any("Traceback" in line or "Errno" in line for line in lines)


def test_a_daemon_that_the_watchdog_ends_leaves_the_place_where_it_hung(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path)
    try:
        plant.start()
        plant.wait_for((plant.state / "status.json").exists)
        assert plant.daemon is not None
        plant.daemon.send_signal(signal.SIGABRT)  # what systemd sends when WatchdogSec is over
        assert plant.daemon.wait(60) == -signal.SIGABRT
    finally:
        plant.close()
    assert "edge/cli/run.py" in (tmp_path / "daemon.log").read_text()


@pytest.mark.parametrize("kind", SENTENCES)
def test_an_event_without_its_details_is_still_said(kind: str) -> None:
    assert sentence(kind, {}) == kind.replace("_", " ")
    assert sentence("something_new", {"size": 3.0, "where": ""}) == "something new: size 3"
