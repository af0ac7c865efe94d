"""A corrupt file, a full disk and a read-only file system stop nothing and lose what was promised, not more."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from igrow.edge.store import SqliteStore, StoreLimits, read_telemetry
from tests import needs
from tests.store.store_helpers import START, number_of, values

ROOT = Path(__file__).resolve().parents[2]


def fill(folder: Path, rows: int = 5000, events: int = 200) -> None:
    store = SqliteStore(folder)
    for index in range(rows):
        store.append(START + 5 * index, values(20.0))
    for index in range(events):
        store.record_event(START + index, "test", {"number": index})
    store.close()


def kinds(store: SqliteStore) -> list[str]:
    return [str(record.body["kind"]) for record in store.records("event", 10**6)]


@pytest.mark.parametrize("name", ["ledger-a.db", "ledger-b.db"])
@pytest.mark.parametrize("how", ["header", "middle", "empty", "truncated"])
def test_no_event_is_lost_when_one_ledger_file_is_damaged(tmp_path: Path, name: str, how: str) -> None:
    fill(tmp_path, rows=1)
    path = tmp_path / name
    damage(path, how)
    (tmp_path / f"{name}-wal").touch()  # as after a power cut, so that the file is checked
    store = SqliteStore(tmp_path)
    numbers = [number_of(r) for r in store.records("event", 10**6) if r.body["kind"] == "test"]
    assert numbers[::-1] == list(range(200))
    store.record_event(START, "after", {})
    assert "after" in kinds(store)
    assert store.health == ""
    store.close()
    # Both twins are whole again: either alone carries everything.
    (tmp_path / name).unlink()
    assert kinds(SqliteStore(tmp_path)).count("test") == 200


def test_damage_that_shows_while_running_is_cured_without_a_restart(tmp_path: Path) -> None:
    fill(tmp_path)
    store = SqliteStore(tmp_path)
    store.append(START + 1e6, values(20.0))
    store.flush()
    for name in ("telemetry.db", "ledger-a.db"):
        damage(tmp_path / name, "all")
    store.close()
    store = SqliteStore(tmp_path)
    for index in range(100):
        store.append(START + 2e6 + 5 * index, values(21.0))
        store.record_event(None, "after", {"number": index})
    store.flush()
    assert kinds(store).count("after") == 100
    assert kinds(store).count("test") == 200
    assert (store.telemetry(START + 2e6, START + 3e6)["air_temperature"] == 21.0).sum() == 100
    assert kinds(store).count("store_repaired") == 2
    assert store.health == ""


@pytest.mark.parametrize("seed", range(8))
def test_damaged_telemetry_is_set_aside_and_its_readable_rows_are_carried_over(tmp_path: Path, seed: int) -> None:
    fill(tmp_path, rows=20_000, events=1)
    path = tmp_path / "telemetry.db"
    content = bytearray(path.read_bytes())
    rng = random.Random(seed)
    page = rng.randrange(6, len(content) // 4096)
    content[page * 4096 : page * 4096 + 4096] = rng.randbytes(4096)
    path.write_bytes(content)
    (tmp_path / "telemetry.db-wal").touch()
    store = SqliteStore(tmp_path)
    telemetry = store.telemetry(0.0, 8e9)
    assert len(telemetry) >= 20_000 - 200
    assert "store_repaired" in kinds(store)
    assert list(tmp_path.glob("telemetry.db.corrupt-1"))


def test_a_file_that_is_no_database_at_all_does_not_stop_the_start(tmp_path: Path) -> None:
    for name in ("telemetry.db", "ledger-a.db", "ledger-b.db"):
        (tmp_path / name).write_bytes(b"\0garbage" * 5000)
    store = SqliteStore(tmp_path)
    store.append(START, values(20.0))
    store.record_event(START, "alive", {})
    assert len(store.telemetry(0.0, 8e9)) == 1
    assert "alive" in kinds(store)
    assert store.health == ""


def test_only_the_two_newest_damaged_files_are_kept(tmp_path: Path) -> None:
    for _ in range(5):
        (tmp_path / "telemetry.db").write_bytes(b"\0garbage" * 5000)
        store = SqliteStore(tmp_path)
        store.append(START, values(20.0))
        store.close()
    assert sorted(path.name for path in tmp_path.glob("*corrupt*")) == [
        "telemetry.db.corrupt-4",
        "telemetry.db.corrupt-5",
    ]


@pytest.mark.parametrize("how", ["removed", "moved", "another"])
def test_files_that_are_taken_away_while_in_use_are_written_anew_with_their_rows(tmp_path: Path, how: str) -> None:
    folder = tmp_path / "store"
    store = SqliteStore(folder)
    for index in range(100):
        store.append(START + 5 * index, values(20.0))
    store.record_event(START, "before", {})
    store.flush()
    if how == "removed":
        shutil.rmtree(folder)
    else:
        folder.rename(tmp_path / "away")
    if how == "another":
        fill(folder, rows=3, events=300)
    store.append(START + 1000.0, values(21.0))
    store.flush()
    store.record_event(START, "after", {})
    store.close()
    again = SqliteStore(folder)
    assert sorted(kinds(again)) == ["after", "before", "store_repaired", "store_repaired", "store_repaired"]
    assert len(again.telemetry(START, START + 1e6)) == 101
    assert again.health == ""


def test_a_full_disk_keeps_events_safe_and_telemetry_waiting(tmp_path: Path) -> None:
    run_with_small_disk(tmp_path, "full")


def test_a_read_only_disk_keeps_everything_waiting_until_it_can_be_written(tmp_path: Path) -> None:
    run_with_small_disk(tmp_path, "read_only")


def run_with_small_disk(tmp_path: Path, scenario: str) -> None:
    """Run a scenario below in a mount namespace of its own, in which /mnt is a disk of 8 MB."""
    needs.mount_namespace()
    command = f"mount -t tmpfs -o size=8M small /mnt && exec {sys.executable} {__file__} {scenario}"
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", command],
        check=False,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("ok\n")


def full_disk(folder: Path) -> None:
    store = SqliteStore(folder)
    for index in range(1000):
        store.append(START + 5 * index, values(20.0))
    store.flush()
    ballast = folder.parent / "ballast"
    with ballast.open("wb", buffering=0) as stream:
        try:
            while True:
                stream.write(b"x" * 4096)
        except OSError:
            pass
    for index in range(300):
        store.record_event(START, "test", {"number": index})
    for index in range(1000, 4000):
        store.append(START + 5 * index, values(20.0))
    assert "rows wait in memory" in store.health, store.health
    assert "events" not in store.health, store.health
    assert len(store.telemetry(0.0, 8e9)) == 4000
    # kill -9 now: a second store on the same files sees every event
    other = SqliteStore(folder)
    assert kinds(other).count("test") == 300
    other.close()
    ballast.unlink()
    store.flush()
    assert store.health == "", store.health
    assert len(read_telemetry(folder, 0.0, 8e9)) == 4000
    store.close()


def read_only_disk(folder: Path) -> None:
    store = SqliteStore(folder, StoreLimits(waiting_rows=2000))
    store.append(START, values(20.0))
    store.record_event(START, "before", {})
    store.close()
    subprocess.run(["mount", "-o", "remount,ro", "/mnt"], check=True)
    store = SqliteStore(folder, StoreLimits(waiting_rows=2000))
    store.record_event(START, "while", {})
    for index in range(1, 6000):
        store.append(START + 5 * index, values(20.0))
    assert "events wait in memory" in store.health, store.health
    assert "telemetry" in store.health
    assert kinds(store)[0] == "while"
    assert len(store._batch) <= 2500
    subprocess.run(["mount", "-o", "remount,rw", "/mnt"], check=True)
    store.flush()
    store.record_event(START, "after", {})
    assert store.health == "", store.health
    assert kinds(store) == ["after", "while", "before"], kinds(store)
    store.close()


def damage(path: Path, how: str) -> None:
    content = bytearray(path.read_bytes())
    if how == "header":
        content[:100] = b"\xff" * 100
    elif how == "middle":
        for start in range(4096, len(content), 4096):
            content[start : start + 64] = b"\xaa" * 64
    elif how == "all":
        content = bytearray(b"\x55" * len(content))
    elif how == "empty":
        content = bytearray()
    else:
        content = content[: len(content) // 2 + 17]
    path.write_bytes(content)


if __name__ == "__main__":
    place = Path("/mnt/store")
    {"full": full_disk, "read_only": read_only_disk}[sys.argv[1]](place)
    print("ok")
