"""What systemd hears."""

import socket

from igrow.edge.pace import TickPace
from igrow.edge.systemd_notify import SystemdNotifier


def test_each_cycle_feeds_the_watchdog_and_a_new_status_is_sent_once(tmp_path):
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(path)
        notifier = SystemdNotifier({"NOTIFY_SOCKET": path})
        notifier.ready()
        notifier.cycle_completed("plan")
        notifier.cycle_completed("plan")
        notifier.stopping()
        heard = [server.recv(4096).decode() for _ in range(4)]
        notifier.close()
    assert heard == ["READY=1", "WATCHDOG=1\nSTATUS=plan", "WATCHDOG=1", "STOPPING=1"]


def test_without_systemd_nothing_is_sent():
    notifier = SystemdNotifier({})
    notifier.ready()
    notifier.cycle_completed("plan")
    notifier.close()


def test_a_socket_that_is_gone_harms_nothing(tmp_path):
    notifier = SystemdNotifier({"NOTIFY_SOCKET": str(tmp_path / "nobody")})
    notifier.cycle_completed("plan")
    notifier.close()


async def test_a_wait_longer_than_the_watchdog_feeds_it_and_then_ends(tmp_path):
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as server:
        server.bind(path)
        notifier = SystemdNotifier({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "150000"})
        pace = TickPace(0.5)
        await pace.wait(notifier)  # the first cycle is due at once
        await pace.wait(notifier)
        notifier.ready()
        heard: list[str] = []
        while not heard or heard[-1] != "READY=1":
            heard.append(server.recv(4096).decode())
        notifier.close()
    assert heard[:-1]
    assert set(heard[:-1]) == {"WATCHDOG=1"}


async def test_a_wait_that_nobody_watches_is_silent(tmp_path):
    assert SystemdNotifier({}).feed_every == float("inf")
    pace = TickPace(0.05)
    for _ in range(3):
        await pace.wait(SystemdNotifier({}))
