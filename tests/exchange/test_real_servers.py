"""The same log over a folder, a real SFTP server and a real S3 interface: it arrives whole, once, and the keys hold."""

from __future__ import annotations

import re
import subprocess
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from igrow.core.exchange import ExchangeError, FolderPlace, Place
from igrow.core.exchange.address import parse_address
from igrow.core.exchange.remote import RemotePlace
from igrow.core.exchange.remote import open_place as open_at_trainer
from igrow.edge.exchange.places import open_place as open_at_gateway
from igrow.edge.exchange.sftp import SftpPlace
from igrow.trainer.publishing import create_keys, publish_in
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World
from tests.exchange.peers import Sftp, s3_server, sftp_server

DIGEST = "ab" * 32


@pytest.fixture(scope="module")
def sftp(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sftp]:
    with sftp_server(tmp_path_factory.mktemp("sftp") / "server") as server:
        yield server


@pytest.fixture(scope="module")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            patch.setenv(name, "testing")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        with s3_server(tmp_path_factory.mktemp("s3") / "server") as url:
            yield url


@pytest.fixture(params=["folder", "sftp", "s3"])
def sides(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Place, Place]:
    """Return the same place as the gateway and as the trainer reach it."""
    if request.param == "folder":
        return FolderPlace(tmp_path / "exchange"), FolderPlace(tmp_path / "exchange")
    if request.param == "sftp":
        server: Sftp = request.getfixturevalue("sftp")
        keys: dict[str, Any] = {"known_hosts": str(server.known_hosts), "identity": str(server.identity)}
        url = f"{server.url}/{tmp_path.name}"
        (server.root / tmp_path.name).mkdir()
        return open_at_gateway(url, **keys), open_at_trainer(url, **keys)
    address, _, query = request.getfixturevalue("s3").partition("?")
    url = f"{address}/{tmp_path.name}?{query}"
    return open_at_gateway(url), open_at_trainer(url)


def test_every_place_keeps_files_whole(sides: tuple[Place, Place]) -> None:
    for place in sides:
        assert place.entries("a/b") == []
        assert place.get("a/b/none", 10) is None
        place.delete("a/b/none")
        place.put("a/b/c d.txt", b"first")
        place.put("a/b/c d.txt", b"second")
        assert [(one.name, one.size) for one in place.entries("a/b")] == [("c d.txt", 6)]
        assert place.get("a/b/c d.txt", 6) == b"second"
        with pytest.raises(ExchangeError, match="more than 5 bytes"):
            place.get("a/b/c d.txt", 5)
        place.delete("a/b/c d.txt")
        assert place.entries("a/b") == []


def test_the_trainer_sees_whose_folders_are_there(sides: tuple[Place, Place]) -> None:
    gateway, trainer = sides
    assert isinstance(trainer, FolderPlace | RemotePlace)
    assert trainer.folders() == []
    gateway.put("north/segments/a.zip", b"a")
    gateway.put("south/reports/b.json", b"b")
    gateway.put("file.txt", b"c")
    assert trainer.folders() == ["north", "south"]


def test_a_log_arrives_once_is_receipted_and_a_bundle_comes_back(sides: tuple[Place, Place], tmp_path: Path) -> None:
    from igrow.core.exchange import Below
    from igrow.edge.updates.signed_source import SignedSource
    from tests.tiny_bundle import write_tiny_bundle

    gateway, trainer = sides
    world = World(tmp_path / "world", gateway)
    for day in range(3):
        world.log(START + day * DAY, START + (day + 1) * DAY)
        assert world.round(START + (day + 1) * DAY + 300).problem == ""
    done = world.collect(START + 3 * DAY, trainer)
    assert (done.segments, done.notes) == (3, [])
    create_keys(tmp_path / "keys")
    made = publish_in(
        write_tiny_bundle(tmp_path / "made", site=SITE).folder, Below(trainer, f"{SITE}/bundles"), tmp_path / "keys"
    )
    status = world.round(START + 3 * DAY + 900)
    assert (status.problem, status.receipted, status.waiting) == ("", 3, 0)
    world.assert_complete()
    source = SignedSource(world.outbox / "bundles", tmp_path / "trust", tmp_path / "keys" / "1.root.json")
    fetched = source.fetch(SITE, ())
    assert fetched is not None
    assert fetched.identity == made.identity
    world.store.close()


def test_a_server_with_another_key_is_refused_on_both_sides(sftp: Sftp, tmp_path: Path) -> None:
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(tmp_path / "other")], check=True)
    other = " ".join((tmp_path / "other.pub").read_text().split()[:2])
    pinned = tmp_path / "known_hosts"
    pinned.write_text(f"[127.0.0.1]:{sftp.port} {other}\n")
    keys: dict[str, Any] = {"known_hosts": str(pinned), "identity": str(sftp.identity)}
    with pytest.raises(ExchangeError, match="not the pinned one"):
        open_at_gateway(sftp.url, **keys).entries("x")
    with pytest.raises(ExchangeError, match="not the pinned one"):
        open_at_trainer(sftp.url, **keys)


def test_a_server_that_comes_back_with_another_key_is_refused_from_then_on(tmp_path: Path) -> None:
    with sftp_server(tmp_path / "one") as first:
        keys: dict[str, Any] = {"known_hosts": str(first.known_hosts), "identity": str(first.identity)}
        gateway = open_at_gateway(first.url, **keys)
        gateway.put("a/b", b"what was sent before")
        assert [one.name for one in gateway.entries("a")] == ["b"]
    with sftp_server(tmp_path / "two", first.port):
        with pytest.raises(ExchangeError, match="not the pinned one"):
            gateway.entries("a")
        with pytest.raises(ExchangeError, match="not the pinned one"):
            gateway.put("a/c", b"never sent")
        with pytest.raises(ExchangeError, match="not the pinned one"):
            open_at_trainer(first.url, **keys)


class SlowDown(BaseHTTPRequestHandler):
    """An S3 that has too much to do."""

    def answer(self) -> None:
        content = b"<Error><Code>SlowDown</Code><Message>Please reduce your request rate.</Message></Error>"
        self.send_response(503)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(b"" if self.command == "HEAD" else content)

    do_GET = do_PUT = do_HEAD = do_DELETE = do_POST = answer  # noqa: N815  (the names that the library asks for)

    def log_message(self, *_: object) -> None:
        pass


def test_a_service_that_asks_for_less_is_away_for_now_and_nothing_is_taken_for_absent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "2")
    server = ThreadingHTTPServer(("127.0.0.1", 0), SlowDown)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    place = open_at_trainer(f"s3://igrow/exchange?endpoint=http://127.0.0.1:{server.server_address[1]}")
    asked: list[Callable[[], object]] = [
        lambda: place.entries("a"),
        lambda: place.get("a/b", 10),
        lambda: place.put("a/b", b"x"),
        lambda: place.delete("a/b"),
    ]
    for ask in asked:
        with pytest.raises(ExchangeError):
            ask()
    server.shutdown()


def test_a_server_whose_key_is_not_known_is_refused_on_both_sides(sftp: Sftp, tmp_path: Path) -> None:
    (tmp_path / "known_hosts").write_text("")
    keys: dict[str, Any] = {"known_hosts": str(tmp_path / "known_hosts"), "identity": str(sftp.identity)}
    with pytest.raises(ExchangeError):
        open_at_gateway(sftp.url, **keys).entries("x")
    with pytest.raises(ExchangeError):
        open_at_trainer(sftp.url, **keys)


def test_a_client_whose_key_the_server_does_not_know_is_told_so(sftp: Sftp, tmp_path: Path) -> None:
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(tmp_path / "mine")], check=True)
    keys: dict[str, Any] = {"known_hosts": str(sftp.known_hosts), "identity": str(tmp_path / "mine")}
    with pytest.raises(ExchangeError, match="does not know our key"):
        open_at_gateway(sftp.url, **keys).entries("x")
    with pytest.raises(ExchangeError, match="does not know our key"):
        open_at_trainer(sftp.url, **keys)


def test_what_is_wrong_with_keys_is_told_on_both_sides(sftp: Sftp, tmp_path: Path) -> None:
    (tmp_path / "empty").write_text("")
    (tmp_path / "rubbish").write_text("rubbish\n")
    (tmp_path / "rubbish").chmod(0o600)
    (tmp_path / "open").write_bytes(sftp.identity.read_bytes())
    (tmp_path / "open").chmod(0o644)
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "secret", "-f", str(tmp_path / "locked")], check=True)
    known = str(sftp.known_hosts)
    at_gateway = {
        (known, "none"): "none: no such file; it must hold our private key",
        (known, "rubbish"): "our private key cannot be read: one of OpenSSH without a passphrase is needed",
        (known, "open"): "others may read our private key, which SSH then does not use: chmod 600",
        (str(tmp_path / "empty"), "open"): "the file of known hosts lacks the server's key, or has it for another port",
        (str(tmp_path / "none"), "open"): f"as `ssh-keyscan -p {sftp.port} 127.0.0.1` prints it",
    }
    for (hosts, identity), told in at_gateway.items():
        with pytest.raises(ExchangeError, match=re.escape(told)):
            open_at_gateway(sftp.url, known_hosts=hosts, identity=str(tmp_path / identity)).entries("x")
    at_trainer = {
        (known, "none"): "none: no such file; it must hold our private key",
        (known, "locked"): "our private key has a passphrase: one without is needed",
        (str(tmp_path / "none"), "open"): f"as `ssh-keyscan -p {sftp.port} 127.0.0.1` prints it",
    }
    for (hosts, identity), told in at_trainer.items():
        with pytest.raises(ExchangeError, match=re.escape(told)):
            open_at_trainer(sftp.url, known_hosts=hosts, identity=str(tmp_path / identity))


def test_a_trainer_without_a_key_is_told_which_option_names_one(
    sftp: Sftp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)
    with pytest.raises(ExchangeError, match="there is no private key to show: name its file with --identity"):
        open_at_trainer(sftp.url, known_hosts=str(sftp.known_hosts))


def test_an_upload_that_was_cut_off_goes_on_where_it_stopped(sftp: Sftp, tmp_path: Path) -> None:
    content = bytes(range(256)) * 4000
    folder = sftp.root / "cut"
    folder.mkdir()
    part = folder / f".x-{DIGEST}.zip.part"
    part.write_bytes(content[:600_000])
    begun = part.stat().st_ino
    place = SftpPlace(
        parse_address(f"{sftp.url}/cut"), known_hosts=sftp.known_hosts, identity=sftp.identity, timeout=60.0
    )
    place.put(f"x-{DIGEST}.zip", content)
    finished = folder / f"x-{DIGEST}.zip"
    assert finished.read_bytes() == content
    assert finished.stat().st_ino == begun, "the file that was begun was gone on with"
    assert not part.exists()


def test_a_server_that_takes_a_connection_and_says_nothing_holds_no_round_for_ever(tmp_path: Path) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        (tmp_path / "known_hosts").write_text("x")
        place = SftpPlace(
            parse_address(f"sftp://nobody@127.0.0.1:{port}/x"),
            known_hosts=tmp_path / "known_hosts", identity=None, timeout=3.0,
        )  # fmt: skip
        with pytest.raises(ExchangeError, match="no end within 3 s"):
            place.entries("x")
