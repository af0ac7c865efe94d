"""The loop of `igrow-edge notify`: ask the daemon, see what is due, hand it to the services."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from igrow.core.errors import IgrowError
from igrow.edge.alarm_levels import Level
from igrow.edge.daemon_file import NotificationSettings
from igrow.edge.notifications.acknowledged import read_acknowledged
from igrow.edge.notifications.message import Message
from igrow.edge.notifications.outbox import Alarm, Outbox, Told
from igrow.edge.notifications.sending import SEND_SECONDS
from igrow.edge.state_file import read_state, write_state

_log = logging.getLogger("igrow.edge.notifications")
OUTBOX_FILE = "outbox.json"
WAIT_SECONDS = SEND_SECONDS + 5.0
"""A service that takes longer is left behind; its sending ends itself before that."""


class Service(Protocol):
    """One way to reach people."""

    @property
    def name(self) -> str:
        """For the log, without passwords."""

    def send(self, message: Message) -> bool:
        """Send; return whether the service took it. May block, may raise."""


class Notifier:
    """What one look at the daemon leads to; remembers in `folder` what was told."""

    def __init__(
        self,
        site: str,
        settings: NotificationSettings,
        services: Sequence[Service],
        fetch: Callable[[], Mapping[str, Any]],
        folder: Path,
        acknowledged: Path,
    ) -> None:
        """`fetch` asks the daemon and raises IgrowError when it does not answer."""
        self._site = site
        self._settings = settings
        self._services = services
        self._fetch = fetch
        self._file = folder / OUTBOX_FILE
        self._acknowledged = acknowledged
        self._outbox = _read(self._file)
        self._alarms: dict[str, Alarm] = {}
        """When the daemon last answered."""
        self._answered: float | None = None

    def look(self, now: float) -> Message | None:
        """Look once; return the message that went out, or None. `now` is in seconds since 1970 UTC."""
        alarms = self._alarms_now(now)
        known = set(read_acknowledged(self._acknowledged))
        message, outbox = self._outbox.due(self._site, alarms, known, now, self._settings)
        if message is not None and not send_to_all(self._services, message):
            return None  # nobody took it: it is due again at the next look
        if outbox != self._outbox:
            self._outbox = outbox
            problem = _write(self._file, outbox)
            if problem:
                _log.warning("what was told cannot be kept, so a restart will tell it again: %s", problem)
        return message

    def _alarms_now(self, now: float) -> dict[str, Alarm]:
        try:
            state = self._fetch()
        except IgrowError as error:
            self._answered = now if self._answered is None else self._answered
            silent = now - self._answered
            if silent >= self._settings.silent_daemon.total_seconds():
                text = f"the daemon has not answered for {silent / 60:.0f} min: {error}"
                return {**self._alarms, "daemon": Alarm(text, Level.CRITICAL)}
            return self._alarms
        self._answered = now
        self._alarms = {
            str(alarm["name"]): Alarm(str(alarm["text"]), Level(alarm["level"])) for alarm in state["alarms"]
        }
        return self._alarms


def send_to_all(services: Sequence[Service], message: Message) -> bool:
    """Send to each service in a thread of its own; return whether one took it.

    A service that fails or hangs keeps nothing from the others, and is written down.
    """
    results: dict[str, bool] = {}

    def attempt(service: Service) -> None:
        try:
            results[service.name] = service.send(message)
        except Exception as error:
            _log.warning("%s: %s: %s", service.name, type(error).__name__, error)
            results[service.name] = False

    threads = [threading.Thread(target=attempt, args=(service,), daemon=True) for service in services]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT_SECONDS)
    for service in services:
        if not results.get(service.name, False):
            why = "refused or failed" if service.name in results else f"did not answer within {WAIT_SECONDS:.0f} s"
            _log.warning("%s %s: %s", service.name, why, message.title)
    return any(results.values())


def _read(path: Path) -> Outbox:
    told = {}
    entries = read_state(path).get("told")
    for name, entry in entries.items() if isinstance(entries, Mapping) else ():
        try:
            told[name] = Told(str(entry["text"]), Level(entry["level"]), float(entry["at"]))
        except (KeyError, TypeError, ValueError):
            continue
    return Outbox(told)


def _write(path: Path, outbox: Outbox) -> str:
    told = {name: {"text": one.text, "level": one.level, "at": one.at} for name, one in outbox.told.items()}
    return write_state(path, {"told": told})
