"""Servers whose answers are larger than they say, or have no end."""

from __future__ import annotations

import http.server
import os
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from igrow.core.exchange import ExchangeError
from igrow.core.exchange.address import parse_address
from igrow.edge.exchange.sftp import SftpPlace
from igrow.trainer.service.forwarding import _post

SFTP = """#!/bin/sh
while read command _ target; do
    case $command in
        -ls) echo "-rw-r--r--    ? 1000  1000   10 Nov 22 09:58 file" ;;
        get) head -c 1000000 /dev/zero > $(echo $target | tr -d '"') ;;
    esac
done
"""


def test_a_file_that_is_larger_than_its_server_says_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "sftp"
    program.write_text(SFTP)
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    (tmp_path / "known_hosts").touch()
    place = SftpPlace(parse_address("sftp://user@host/folder"), known_hosts=tmp_path / "known_hosts", identity=None)
    with pytest.raises(ExchangeError, match="more than 1000 bytes"):
        place.get("file", 1000)
    assert place.get("file", 1_000_000) == bytes(1_000_000)


def test_a_database_that_answers_without_end_is_not_listened_to() -> None:
    class Endless(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.end_headers()
            with suppress(OSError):
                while True:
                    self.wfile.write(bytes(2**16))

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Endless) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        _post(f"http://127.0.0.1:{server.server_port}/write?db=x", b"greenhouse,site=a air_co2=400 1\n")
        server.shutdown()
