"""What systemd hears."""

import socket

import pytest
from daemon_bench import write_files

from edge.configuration import load_configuration
from edge.daemon import refuse_cycles_slower_than_the_watchdog
from edge.notify import Notifier
from igrow_core.errors import IgrowError


def test_each_cycle_feeds_the_watchdog_and_a_new_status_is_sent_once(tmp_path):
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(path)
        notifier = Notifier({"NOTIFY_SOCKET": path})
        notifier.ready()
        notifier.cycle_completed("plan")
        notifier.cycle_completed("plan")
        notifier.stopping()
        heard = [server.recv(4096).decode() for _ in range(4)]
        notifier.close()
    assert heard == ["READY=1", "WATCHDOG=1\nSTATUS=plan", "WATCHDOG=1", "STOPPING=1"]


def test_without_systemd_nothing_is_sent():
    notifier = Notifier({})
    notifier.ready()
    notifier.cycle_completed("plan")
    notifier.close()


def test_a_socket_that_is_gone_harms_nothing(tmp_path):
    notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / "nobody")})
    notifier.cycle_completed("plan")
    notifier.close()


def test_a_cycle_slower_than_the_watchdog_is_refused_at_the_start(tmp_path):
    watchdog = Notifier({"WATCHDOG_USEC": "120000000"}).watchdog_seconds
    slow = load_configuration(write_files(tmp_path, 5020, clock="system", interval="90 s"))
    with pytest.raises(IgrowError, match="at most 60 s"):
        refuse_cycles_slower_than_the_watchdog(slow, watchdog)
    refuse_cycles_slower_than_the_watchdog(slow, Notifier({}).watchdog_seconds)
    lockstep = load_configuration(write_files(tmp_path, 5020, clock="lockstep", interval="5 min"))
    refuse_cycles_slower_than_the_watchdog(lockstep, watchdog)
