"""The daemon as a process that may open few files, while visitors of its status port take all of them."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.attacked_daemon import SAFE, AttackedDaemon
from tests.service.running_daemon import COMMAND, ROOT

FEW = 40


@pytest.fixture
def attacked(tmp_path: Path) -> Iterator[AttackedDaemon]:
    daemon = AttackedDaemon(tmp_path)
    yield daemon
    daemon.close()


def test_visitors_that_take_the_last_handle_cost_one_line_and_no_beat(attacked: AttackedDaemon) -> None:
    attacked.start()
    assert attacked.process is not None
    attacked.controls()
    attacked.until(attacked.port_of_status)
    resource.prlimit(attacked.process.pid, resource.RLIMIT_NOFILE, (FEW, FEW))
    visitors = [socket.create_connection(("127.0.0.1", attacked.port_of_status())) for _ in range(60)]
    attacked.until(lambda: "nobody can be taken in" in attacked.log())
    attacked.beats(10)
    for visitor in visitors:
        visitor.close()
    attacked.until(lambda: served(attacked.port_of_status()))
    assert len(attacked.log().splitlines()) < 50
    assert "Traceback" not in attacked.log()
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    assert {name: attacked.plc.shows(name) for name in SAFE} == SAFE


def test_a_daemon_that_is_started_without_standard_files_gives_their_numbers_to_no_file(
    attacked: AttackedDaemon,
) -> None:
    """What is said to people, and by its processes, would go into the file or the line that has the number."""
    (attacked.folder / "daemon.log").touch()
    with_bundle = attacked.configuration.read_text().replace("bundle: null\n", "")  # so that it has processes
    attacked.configuration.write_text(with_bundle)
    attacked.process = subprocess.Popen(
        ["sh", "-c", 'exec "$@" 0<&- 1>&- 2>&-', "sh", *COMMAND, "run", str(attacked.configuration)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    attacked.controls()
    files = Path(f"/proc/{attacked.process.pid}/fd")
    assert [str((files / str(number)).readlink()) for number in range(3)] == [os.devnull] * 3
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    assert {name: attacked.plc.shows(name) for name in SAFE} == SAFE


def served(port: int) -> bool:
    with socket.create_connection(("127.0.0.1", port)) as line:
        line.sendall(b"GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n")
        return line.recv(100).startswith(b"HTTP/1.1 200")
