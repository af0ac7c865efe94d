"""The daemon as a process whose surroundings hang: nobody reads its journal, a file never opens; it runs and ends."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
from pathlib import Path

from tests.service.running_daemon import COMMAND, RunningDaemon

SMALLEST_PIPE = 4096
"""Bytes."""
ENDS_WITHIN = 60.0
"""Seconds, on however busy a machine; what hangs, hangs for ever."""


NO_PLANS = "bundle: null\nplanning: {enabled: false}\n"
"""A simulated plant would wait for them."""


def cycles(plant: RunningDaemon) -> int:
    try:
        return int(json.loads((plant.state / "status.json").read_text())["state"]["cycle"])
    except (OSError, ValueError):
        return 0


def start_with(plant: RunningDaemon, output: int) -> None:
    command = [*COMMAND, "run", str(plant.configuration), "--verbose"]
    plant.daemon = subprocess.Popen(command, env=plant._environment, stdout=output, stderr=output)


def test_a_journal_that_nobody_reads_holds_neither_the_cycles_nor_the_stop(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path, extra=NO_PLANS)
    reading, writing = os.pipe()
    try:
        fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, SMALLEST_PIPE)
        os.set_blocking(writing, False)
        while True:  # nothing more fits in from the start
            try:
                os.write(writing, b"x" * 512)
            except BlockingIOError:
                break
        os.set_blocking(writing, True)
        start_with(plant, writing)
        plant.wait_for(lambda: cycles(plant) > 20)
        assert plant.daemon is not None
        plant.daemon.send_signal(signal.SIGTERM)
        assert plant.daemon.wait(ENDS_WITHIN) == 0
    finally:
        os.close(reading)
        os.close(writing)
        plant.close()


def test_a_journal_whose_reader_is_gone_ends_nothing(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path, extra=NO_PLANS)
    reading, writing = os.pipe()
    try:
        start_with(plant, writing)
        os.close(reading)
        plant.wait_for(lambda: cycles(plant) > 20)
        assert plant.daemon is not None
        plant.daemon.send_signal(signal.SIGTERM)
        assert plant.daemon.wait(ENDS_WITHIN) == 0
    finally:
        os.close(writing)
        plant.close()


def test_a_stop_ends_the_process_while_files_that_were_handed_over_hang(tmp_path: Path) -> None:
    """Overrides, and the trust of updates, are pipes that nobody writes to: two threads never come back."""
    plant = RunningDaemon(tmp_path, extra=NO_PLANS + "updates: {trusted_root: root.json}\n")
    text = plant.configuration.read_text()  # a simulated plant would wait for its files, a real one does not
    plant.configuration.write_text(text.replace("clock: lockstep", "clock: system").replace("5 min", "1 s"))
    plant.state.mkdir()
    for path in (plant.state / "override.json", tmp_path / "root.json"):
        os.mkfifo(path)
    try:
        plant.start()
        plant.wait_for(lambda: cycles(plant) > 5)
        assert plant.daemon is not None
        plant.daemon.send_signal(signal.SIGTERM)
        assert plant.daemon.wait(ENDS_WITHIN) == 0
        assert "stopped: the safe setpoints were written" in (tmp_path / "daemon.log").read_text()
    finally:
        plant.close()
