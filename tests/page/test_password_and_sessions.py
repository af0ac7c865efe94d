"""The password is kept as a hash, a sign-in ends, and guessing is slow."""

from __future__ import annotations

import io
import json
import stat
import tarfile
from pathlib import Path

import pytest

from igrow.core.errors import IgrowError
from igrow.edge.backup import back_up
from igrow.edge.cli import main
from igrow.edge.configuration import load_configuration
from igrow.edge.page.password import PASSWORD_FILE, hashed, read_password, remove_password, write_password
from igrow.edge.page.sessions import ALL_TRIES, MOST_ADDRESSES, MOST_SESSIONS, TRIES, TRY_SECONDS, Sessions, Tries
from tests.page.page_bench import PASSWORD, fill_log, write_greenhouse


def test_only_a_hash_is_kept_and_only_its_owner_reads_it(tmp_path):
    write_password(tmp_path, hashed(PASSWORD))
    path = tmp_path / PASSWORD_FILE
    assert PASSWORD not in path.read_text()
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    kept = read_password(tmp_path)
    assert kept is not None
    assert kept.fits(PASSWORD)
    assert not kept.fits(PASSWORD + " ")
    assert not kept.fits("")
    assert hashed(PASSWORD).digest != kept.digest  # each has its own salt


@pytest.mark.parametrize("word", ["", "short", "x" * 300])
def test_a_password_that_is_too_short_or_too_long_is_refused(word):
    with pytest.raises(IgrowError, match="10 to 256 are right"):
        hashed(word)


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"n": 1}', '{"n": 2, "r": 8, "p": 1, "salt": "00", "digest": "00"}',
                '{"n": 1073741824, "r": 8, "p": 1, "salt": "00", "digest": "' + "00" * 32 + '"}'],
)  # fmt: skip
def test_a_file_that_makes_no_sense_is_no_password(tmp_path, content):
    (tmp_path / PASSWORD_FILE).write_text(content)
    assert read_password(tmp_path) is None


def test_the_command_sets_and_removes_it(tmp_path, capsys, monkeypatch):
    path = write_greenhouse(tmp_path)
    monkeypatch.setattr("sys.stdin", io.StringIO(PASSWORD + "\n"))
    assert main(["password", str(path)]) == 0
    kept = read_password(tmp_path / "state")
    assert kept is not None and kept.fits(PASSWORD)
    monkeypatch.setattr("sys.stdin", io.StringIO("short\n"))
    assert main(["password", str(path)]) == 2
    assert "10 to 256 are right" in capsys.readouterr().err
    assert main(["password", str(path), "--remove"]) == 0
    assert read_password(tmp_path / "state") is None
    assert not remove_password(tmp_path / "state")


def test_a_password_before_the_first_start_leaves_no_folder(tmp_path, capsys, monkeypatch):
    path = write_greenhouse(tmp_path)
    (tmp_path / "state").rmdir()
    monkeypatch.setattr("sys.stdin", io.StringIO(PASSWORD + "\n"))
    assert main(["password", str(path)]) == 2
    assert "the daemon makes it when it first starts" in capsys.readouterr().err
    assert not (tmp_path / "state").exists()


def test_no_backup_holds_it(tmp_path):
    configuration = load_configuration(write_greenhouse(tmp_path))
    fill_log(tmp_path, days=0.1)
    write_password(tmp_path / "state", hashed(PASSWORD))
    (tmp_path / "state" / "override.json").write_text("{}")
    back_up(configuration, tmp_path / "backup.tar.gz")
    with tarfile.open(tmp_path / "backup.tar.gz") as archive:
        names = [Path(name).name for name in archive.getnames()]
    assert "override.json" in names
    assert PASSWORD_FILE not in names


def test_the_file_of_the_password_is_plain_json(tmp_path):
    write_password(tmp_path, hashed(PASSWORD))
    assert json.loads((tmp_path / PASSWORD_FILE).read_text())["scheme"] == "scrypt"


def test_a_session_ends_by_time_by_hand_and_by_a_new_password():
    now = [0.0]
    sessions = Sessions(3600.0, lambda: now[0])
    first, second, third = (sessions.begin("Anna", b"digest") for _ in range(3))
    assert len({first, second, third}) == 3
    found = sessions.find(first, b"digest")
    assert found is not None and found.who == "Anna"
    assert sessions.find(first, b"another") is None
    assert sessions.find(first, b"digest") is None  # it does not come back with the old password
    sessions.end(second)
    assert sessions.find(second, b"digest") is None
    now[0] = 3601.0
    assert sessions.find(third, b"digest") is None
    for nobody in (None, "", "guess"):
        assert sessions.find(nobody, b"digest") is None
    assert sessions.find(third, None) is None


def test_sessions_are_bounded_and_the_oldest_goes():
    sessions = Sessions(3600.0)
    secrets = [sessions.begin("Anna", b"digest") for _ in range(MOST_SESSIONS + 1)]
    assert sessions.find(secrets[0], b"digest") is None
    assert sessions.find(secrets[1], b"digest") is not None


def test_one_address_that_fails_waits_and_others_do_not():
    now = [0.0]
    tries = Tries(lambda: now[0])
    for _ in range(TRIES):
        assert tries.wait("10.0.0.1") == 0.0
        tries.failed("10.0.0.1")
    assert tries.wait("10.0.0.1") == TRY_SECONDS
    assert tries.wait("10.0.0.2") == 0.0
    now[0] = TRY_SECONDS
    assert tries.wait("10.0.0.1") == 0.0
    tries.failed("10.0.0.1")
    assert tries.wait("10.0.0.1") == TRY_SECONDS
    tries.succeeded("10.0.0.1")
    assert tries.wait("10.0.0.1") == 0.0


def test_addresses_of_one_net_are_one_visitor():
    tries = Tries(lambda: 0.0)
    for number in range(TRIES):
        tries.failed(f"2001:db8::{number + 1:x}")
    assert tries.wait("2001:db8::ffff") > 0.0
    assert tries.wait("2001:db8:0:1::1") == 0.0


def test_all_addresses_together_are_bounded_in_tries_and_in_memory():
    now = [0.0]
    tries = Tries(lambda: now[0])
    for number in range(ALL_TRIES):
        assert tries.wait(f"10.0.0.{number}") == 0.0
    assert tries.wait("10.0.1.1") > 0.0
    for number in range(3 * MOST_ADDRESSES):
        tries.failed(f"10.{number // 65536}.{number // 256 % 256}.{number % 256}")
    assert len(tries._failures) == MOST_ADDRESSES
