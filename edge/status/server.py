"""A small HTTP server for what programs ask, read-only; implements `igrow.edge.ports.StatusService`."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import logging
import math
import time
from collections.abc import Callable
from enum import Enum
from pathlib import Path

from igrow.edge.hand_off import HandOff, LateError
from igrow.edge.listening import Listener
from igrow.edge.ports import Snapshot
from igrow.edge.status.metrics import render_metrics

_log = logging.getLogger("igrow.edge.status")
CONNECTIONS = 16
"""At once; more are turned away, as a page must never cost the cycle its time."""
MOST_CONNECTIONS = 64
"""At once; more are hung up on without a word, as each costs a handle for as long as its visitor says nothing."""
REQUEST_BYTES = 8192
REQUEST_SECONDS = 5.0
STATE_FILE_SECONDS = 10.0
OWN_NAMES = ("localhost", "127.0.0.1", "[::1]")
"""What a visitor of this very machine calls it. A page of another site that had its own name point here (DNS rebinding)
would say that name."""
WHERE = """For programs: /health, /metrics and /state.json.
For people: the grower's page, http://localhost:8421 (igrow-edge page; docs/page.md).
"""
CLOSE_SECONDS = 1.0
"""How long the stop waits for the last state to be left."""


class StatusServer:
    """Serves the newest snapshot on localhost."""

    def __init__(
        self,
        port: int,
        state_file: Path | None = None,
        *,
        late_after: float = 60.0,
        wall: Callable[[], float] = time.monotonic,
    ) -> None:
        """Prepare to serve.

        Args:
            port: TCP port on localhost; 0 takes a free one.
            state_file: where the state is left too, for when nobody can ask the port; None leaves it nowhere.
            late_after: seconds (on `wall`) without a completed cycle after which health is lost.
            wall: monotonic clock in seconds.
        """
        self.port = port
        """The port that is listened to; 0 becomes the one that the system chose."""
        self._unheard = ""
        self._unwritten = ""
        self._state_file = state_file
        self._written_at = -math.inf
        self._late_after = late_after
        self._wall = wall
        self._published_at = -math.inf
        self._snapshot: Snapshot | None = None
        self._listener: Listener | None = None
        self._visits: set[asyncio.Task[None]] = set()
        self._aside = HandOff("status file")

    @property
    def health(self) -> str:
        """Empty while it listens and can leave its file, else one line."""
        return "; ".join(filter(None, (self._unreachable, self._aside.problem or self._unwritten)))

    @property
    def _unreachable(self) -> str:
        why = self._unheard or (self._listener.problem if self._listener is not None else "")
        return f"status page: port {self.port} on localhost: {why}" if why else ""

    async def start(self) -> None:
        """Begin to listen; a port that is taken is a problem to report, not a reason to stop."""
        try:
            self._listener = Listener("127.0.0.1", self.port, self._serve, limit=REQUEST_BYTES)
        except OSError as error:
            self._unheard = error.strerror or str(error)
            _log.warning("%s", self._unreachable)
            return
        self.port = self._listener.port

    def publish(self, snapshot: Snapshot) -> None:
        """Take the newest snapshot. Never blocks; rendering happens when somebody asks."""
        self._snapshot = snapshot
        self._published_at = self._wall()
        if self._state_file is not None and self._published_at - self._written_at >= STATE_FILE_SECONDS:
            self._written_at = self._published_at
            self._leave_state()

    async def close(self) -> None:
        """Stop listening, turn visitors away, and leave the last state where the disk takes it."""
        if self._listener is not None:
            self._listener.close()
        self._leave_state()
        self._aside.close(CLOSE_SECONDS)

    def _leave_state(self) -> None:
        """Have the newest state written, unless an older one is still being written."""
        if self._state_file is None or self._snapshot is None or self._aside.waiting:
            return
        file, text = self._state_file, json.dumps({"port": self.port, "state": plain(self._snapshot)})
        with contextlib.suppress(LateError):
            self._aside.do(lambda: self._write_state(file, text))

    def _write_state(self, file: Path, text: str) -> None:
        partial = file.with_name(file.name + ".part")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            # Not synchronised: it is made anew all the time, and a power cut may take it.
            partial.write_text(text)
            partial.replace(file)
            self._unwritten = ""
        except OSError as error:
            self._unwritten = f"status file: {file}: {error.strerror or error}"

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        visit = asyncio.current_task()
        assert visit is not None
        try:
            if len(self._visits) < MOST_CONNECTIONS:
                self._visits.add(visit)
                async with asyncio.timeout(REQUEST_SECONDS):
                    await self._visit(reader, writer)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # the visitor is gone, slow, or no browser; none of it is the daemon's concern
        finally:
            self._visits.discard(visit)
            # Not closed in good order: a visitor who does not read what was written would have to be waited for.
            writer.transport.abort()

    async def _visit(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        status, kind, body = await self._answer(reader)
        head = (
            f"HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {len(body)}\r\n"
            "Cache-Control: no-store\r\nConnection: close\r\nX-Content-Type-Options: nosniff\r\n"
            "Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; img-src data:\r\n\r\n"
        )
        writer.write(head.encode() + body)
        await writer.drain()
        writer.close()
        await writer.wait_closed()

    async def _answer(self, reader: asyncio.StreamReader) -> tuple[str, str, bytes]:
        request = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        parts = request.split("\r\n", 1)[0].split(" ")
        if len(self._visits) > CONNECTIONS:
            return "503 Service Unavailable", "text/plain", b"too many visitors\n"
        if len(parts) != 3 or parts[0] not in {"GET", "HEAD"}:
            return "405 Method Not Allowed", "text/plain", b"read-only: GET it is\n"
        if not _own_name(request):
            return "421 Misdirected Request", "text/plain", b"this page is for localhost: http://localhost:PORT/\n"
        status, kind, text = self._page(parts[1].split("?", 1)[0])
        return status, kind, b"" if parts[0] == "HEAD" else text.encode()

    def _page(self, path: str) -> tuple[str, str, str]:
        snapshot = self._snapshot
        late = self._wall() - self._published_at > self._late_after
        if path == "/health":
            healthy = snapshot is not None and not late and snapshot.link_ok
            body = json.dumps(self._health(healthy, late), indent=1) + "\n"
            return ("200 OK" if healthy else "503 Service Unavailable"), "application/json", body
        if path not in {"/", "/metrics", "/state.json"}:
            return "404 Not Found", "text/plain", "there are /, /health, /metrics and /state.json\n"
        if path == "/":
            return "200 OK", "text/plain", WHERE
        if snapshot is None:
            return "503 Service Unavailable", "text/plain", "no cycle has been completed yet\n"
        if path == "/metrics":
            return "200 OK", "text/plain; version=0.0.4", render_metrics(snapshot)
        return "200 OK", "application/json", json.dumps(plain(snapshot)) + "\n"

    def _health(self, healthy: bool, late: bool) -> dict[str, object]:
        snapshot = self._snapshot
        if snapshot is None:
            return {"ok": False, "why": "no cycle has been completed yet"}
        why = "no cycle was completed lately" if late else "" if snapshot.link_ok else "the PLC does not answer"
        return {
            "ok": healthy,
            "why": why,
            "cycle": snapshot.cycle,
            "source": snapshot.source,
            "clock_ok": snapshot.clock_ok,
            "alarms": [alarm.text for alarm in snapshot.alarms],
            "problems": list(snapshot.problems),
        }


def _own_name(request: str) -> bool:
    """Tell whether a request names this machine as its host, exactly once."""
    lines = [line.partition(":") for line in request.split("\r\n")[1:]]
    hosts = [value.strip().lower() for name, _, value in lines if name.strip().lower() == "host"]
    return len(hosts) == 1 and any(
        hosts[0] == name or (hosts[0].startswith(f"{name}:") and hosts[0][len(name) + 1 :].isdigit())
        for name in OWN_NAMES
    )


def plain(value: object) -> object:
    """Return a snapshot as what JSON knows; numbers that are not finite become None."""
    if isinstance(value, Enum):
        return value.value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)
