"""What asks the daemon, where something else answers on its port."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress

import pytest

from igrow.core.errors import IgrowError
from igrow.edge.status.client import fetch


def answered_by(answer: Callable[[socket.socket], None]) -> int:
    """Return the port of a server that answers one visitor."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with server, server.accept()[0] as visitor, suppress(OSError):
            visitor.recv(4096)
            answer(visitor)

    threading.Thread(target=serve, daemon=True).start()
    return int(server.getsockname()[1])


def page(body: bytes, status: bytes = b"200 OK") -> Callable[[socket.socket], None]:
    return lambda visitor: visitor.sendall(b"HTTP/1.1 " + status + b"\r\n\r\n" + body)


def endless(status: bytes) -> Callable[[socket.socket], None]:
    def answer(visitor: socket.socket) -> None:
        page(b"", status)(visitor)
        while True:
            visitor.sendall(bytes(2**16))

    return answer


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (lambda visitor: visitor.sendall(b"SSH-2.0-OpenSSH_9.6\r\n"), "no igrow-edge"),
        (lambda visitor: visitor.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n{"), "not JSON"),
        (page(b"<html>"), "not JSON"),
        (page(b"[]"), "a list where an object"),
        (page(b"{}"), "no igrow-edge"),
        (page(b"[" * 100_000), "nested too deeply"),
        (endless(b"200 OK"), "at most"),
        (endless(b"503 Service Unavailable"), "says"),
        (lambda visitor: None, "no daemon answers"),
    ],
)
def test_what_is_no_daemon_is_one_line(answer: Callable[[socket.socket], None], told: str) -> None:
    with pytest.raises(IgrowError, match=told) as caught:
        fetch(answered_by(answer))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
