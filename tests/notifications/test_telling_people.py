"""The process that tells people: broken services, a silent daemon, a restart, an acknowledgement."""

from __future__ import annotations

import contextlib
import http.server
import resource
import socket
import threading
import time

import pytest

from igrow.core.errors import IgrowError
from igrow.edge.alarm_levels import Level
from igrow.edge.daemon_file import NotificationSettings
from igrow.edge.notifications import notifier as module
from igrow.edge.notifications import sending
from igrow.edge.notifications.acknowledged import acknowledge, read_acknowledged
from igrow.edge.notifications.message import Message
from igrow.edge.notifications.notifier import Notifier, send_to_all
from igrow.edge.notifications.sending import MOST_BYTES
from igrow.edge.notifications.services import open_services


class Daemon:
    def __init__(self):
        self.alarms = []
        self.answers = True

    def alarm(self, name, text, level=Level.WARNING):
        self.alarms = [{"name": name, "text": text, "level": str(level)}]

    def fetch(self):
        if not self.answers:
            raise IgrowError("no daemon answers on port 8420 of this machine; is igrow-edge running?")
        return {"alarms": self.alarms}


class Mailbox:
    name = "mailbox"

    def __init__(self):
        self.messages = []

    def send(self, message):
        self.messages.append(message)
        return True


class Broken:
    name = "broken"

    def send(self, message):
        raise ConnectionResetError("gone")


class Hanging:
    name = "hanging"

    def send(self, message):
        time.sleep(60.0)
        return True


def notifier(daemon, tmp_path, *services):
    settings = NotificationSettings()
    return Notifier("hillside", settings, services, daemon.fetch, tmp_path, tmp_path / "acknowledged.json")


def test_a_daemon_that_does_not_answer_is_an_alarm(tmp_path):
    daemon, mailbox = Daemon(), Mailbox()
    one = notifier(daemon, tmp_path, mailbox)
    one.look(0.0)
    daemon.answers = False
    one.look(60.0)
    assert mailbox.messages == []
    one.look(301.0)
    assert mailbox.messages[-1].level is Level.CRITICAL
    assert "the daemon has not answered for 5 min" in mailbox.messages[-1].body
    daemon.answers = True
    one.look(400.0)
    assert mailbox.messages[-1].body.startswith("over: the daemon has not answered")


def test_alarms_that_stood_when_the_daemon_fell_silent_are_not_told_as_over(tmp_path):
    daemon, mailbox = Daemon(), Mailbox()
    daemon.alarm("climate too_cold", "too cold", Level.CRITICAL)
    one = notifier(daemon, tmp_path, mailbox)
    one.look(0.0)
    daemon.answers = False
    one.look(600.0)
    assert not any("over:" in message.body for message in mailbox.messages)


def test_a_restart_tells_nothing_twice(tmp_path):
    daemon, mailbox = Daemon(), Mailbox()
    daemon.alarm("sensor wind_speed", "frozen")
    notifier(daemon, tmp_path, mailbox).look(0.0)
    notifier(daemon, tmp_path, mailbox).look(60.0)
    assert len(mailbox.messages) == 1


def test_a_broken_and_a_hanging_service_keep_nothing_from_the_others(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "WAIT_SECONDS", 0.2)
    mailbox = Mailbox()
    assert send_to_all([Broken(), Hanging(), mailbox], Message("title", "body", Level.NOTICE))
    assert len(mailbox.messages) == 1


def test_what_no_service_took_is_tried_again(tmp_path):
    daemon, mailbox = Daemon(), Mailbox()
    daemon.alarm("sensor wind_speed", "frozen")
    assert notifier(daemon, tmp_path, Broken()).look(0.0) is None
    assert notifier(daemon, tmp_path, mailbox).look(15.0) is not None


def test_an_acknowledgement_holds_until_the_alarm_is_over(tmp_path):
    path = tmp_path / "acknowledged.json"
    assert acknowledge(path, ["a"], "ann", 5.0, ["a", "b"]) == ""
    assert acknowledge(path, ["b"], "bob", 6.0, ["b"]) == ""
    assert {name: one.by for name, one in read_acknowledged(path).items()} == {"b": "bob"}


def test_an_address_that_nobody_knows_is_refused_without_its_password():
    with pytest.raises(IgrowError, match="number 2: Apprise knows no such nonsense:// address") as error:
        open_services(["json://localhost/", "nonsense://user:secret@host"])
    assert "secret" not in str(error.value)


def test_a_web_hook_gets_title_and_text():
    received = []

    class Hook(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            received.append(self.rfile.read(int(self.headers["Content-Length"])).decode())
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), Hook)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        (service,) = open_services([f"json://127.0.0.1:{server.server_port}/"])
        assert service.send(Message("hillside: CRITICAL, an alarm", "too cold", Level.CRITICAL))
    finally:
        server.shutdown()
        server.server_close()
    assert '"title": "hillside: CRITICAL, an alarm"' in received[0]
    assert "too cold" in received[0]


def test_an_answer_without_end_takes_no_memory_and_is_no_success():
    read = 0

    class Endless(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.end_headers()
            nonlocal read
            with contextlib.suppress(OSError):
                while True:
                    read += self.wfile.write(bytes(2**20))

        def log_message(self, *_):
            pass

    server = http.server.HTTPServer(("127.0.0.1", 0), Endless)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        (service,) = open_services([f"json://127.0.0.1:{server.server_port}/"])
        assert not service.send(Message("hillside: CRITICAL, an alarm", "too cold", Level.CRITICAL))
    finally:
        server.shutdown()
        server.server_close()
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MOST_BYTES
    assert read < 2 * MOST_BYTES


def test_a_service_that_answers_drop_by_drop_is_given_up(monkeypatch):
    monkeypatch.setattr(sending, "SEND_SECONDS", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        (service,) = open_services([f"json://127.0.0.1:{silent.getsockname()[1]}/"])
        with pytest.raises(TimeoutError, match="no end within"):
            service.send(Message("title", "body", Level.NOTICE))
