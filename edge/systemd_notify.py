"""Tells systemd how the daemon is (sd_notify): ready, alive, reloading, stopping, and one line of status.

The watchdog is fed by each completed cycle and, since cycles may be rarer than the watchdog is patient, by the wait
between two of them, which knows when it ends. Nothing else feeds it: a daemon whose cycle hangs is restarted, however
alive its other tasks are. The protocol is a datagram to the socket named by NOTIFY_SOCKET (sd_notify(3)).
"""

from __future__ import annotations

import math
import os
import socket
import time
from collections.abc import Mapping


class SystemdNotifier:
    """Sends to systemd, or nowhere when the daemon was started by hand."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._address = environment.get("NOTIFY_SOCKET", "")
        # An address that begins with @ lies in Linux' abstract namespace, whose names begin with a zero byte.
        if self._address.startswith("@"):
            self._address = "\0" + self._address[1:]
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) if self._address else None
        if self._socket is not None:
            self._socket.setblocking(False)
        self._status = ""
        microseconds = environment.get("WATCHDOG_USEC", "")
        self.feed_every = int(microseconds) / 3e6 if microseconds.isdigit() else math.inf
        """Seconds between two signs of life that the watchdog can rely on: a third of WatchdogSec, infinite without."""

    def ready(self) -> None:
        """Report that the daemon runs; the PLC need not answer yet."""
        self._send("READY=1")

    def reloading(self) -> None:
        """Report that the configuration is being read again; `ready` ends it."""
        self._send(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def stopping(self) -> None:
        """Report that the daemon is on its way out."""
        self._send("STOPPING=1")

    def cycle_completed(self, status: str) -> None:
        """Feed the watchdog; show one line in `systemctl status`."""
        message = "WATCHDOG=1"
        if status != self._status:
            message += f"\nSTATUS={status}"
            self._status = status
        self._send(message)

    def still_waiting(self) -> None:
        """Feed the watchdog while the next cycle is not due yet."""
        self._send("WATCHDOG=1")

    def close(self) -> None:
        """Let go of the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError:
            # Nobody listens, or the queue is full: the watchdog itself is the remedy for the second.
            return
