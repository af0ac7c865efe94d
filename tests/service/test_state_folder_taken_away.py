"""The daemon as a process whose state folder, or a part of it, somebody removes or replaces while it runs."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from igrow.edge.store import read_records
from tests.service.attacked_daemon import AttackedDaemon

HAND = 555.0


@pytest.fixture
def attacked(tmp_path: Path) -> Iterator[AttackedDaemon]:
    daemon = AttackedDaemon(tmp_path)
    yield daemon
    daemon.close()


def removed(state: Path) -> None:
    shutil.rmtree(state)


def replaced(state: Path) -> None:
    state.rename(state.with_name("away"))
    state.mkdir()


def store_removed(state: Path) -> None:
    shutil.rmtree(state / "store")


def ledgers_removed(state: Path) -> None:
    """Their write-ahead logs are left behind, which must not be replayed into anything."""
    for name in ("ledger-a.db", "ledger-b.db"):
        (state / "store" / name).unlink()


def older_ones_in_their_place(state: Path) -> None:
    for name in ("ledger-a.db", "ledger-b.db"):
        path = state / "store" / name
        shutil.copy(path, path.with_suffix(".copy"))
        path.with_suffix(".copy").replace(path)


def events(daemon: AttackedDaemon) -> list[str]:
    return [str(record.body["kind"]) for record in read_records(daemon.state / "store", "event")]


def set_by_hand(daemon: AttackedDaemon) -> None:
    daemon.beats(3)  # so that what was written before has been seen
    with daemon.plc.lock:
        daemon.plc.set_value("co2_setpoint", HAND)
    daemon.until(lambda: "by hand" in daemon.log())
    daemon.beats(2)


@pytest.mark.parametrize("what", [removed, replaced, store_removed, ledgers_removed, older_ones_in_their_place])
def test_what_is_taken_away_is_written_anew_with_all_that_it_held(
    attacked: AttackedDaemon, what: Callable[[Path], None]
) -> None:
    """A hand from before is respected after a `kill -9`, and no event is gone."""
    attacked.start()
    attacked.controls()
    set_by_hand(attacked)
    what(attacked.state)
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: attacked.log().count("written anew") == 2)
    attacked.beats(3)
    attacked.until((attacked.state / "status.json").exists)
    before = events(attacked)
    assert {"started", "changed_by_hand", "reloaded", "store_repaired"} <= set(before)
    assert attacked.process is not None
    attacked.process.kill()
    attacked.process.wait()
    attacked.start()
    attacked.beats(5)
    assert attacked.plc.shows("co2_setpoint") == HAND
    assert events(attacked)[-len(before) :] == before


def test_a_folder_that_became_a_file_holds_nothing_and_all_is_kept_once_it_is_one_again(
    attacked: AttackedDaemon,
) -> None:
    attacked.start()
    attacked.controls()
    store = attacked.state / "store"
    store.rename(store.with_name("away"))
    store.write_text("a file")
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: any("taken away or replaced" in text for text in attacked.status().get("problems", [])))
    attacked.beats(3)
    store.unlink()
    attacked.signal(signal.SIGHUP)
    attacked.until(lambda: attacked.log().count("written anew") == 2)
    attacked.until(lambda: events(attacked).count("reloaded") == 2)
    assert "started" in events(attacked)


def test_a_start_that_cannot_read_what_was_noted_leaves_a_hand_alone(attacked: AttackedDaemon) -> None:
    """As where the folder's owner was changed: nobody knows which hands are to be respected."""
    attacked.start()
    attacked.controls()
    set_by_hand(attacked)
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    for name in ("ledger-a.db", "ledger-b.db"):
        path = attacked.state / "store" / name
        path.unlink()
        path.mkdir()
    attacked.start()
    attacked.until(lambda: "what was set by hand before the start cannot be read" in attacked.log())
    attacked.beats(5)
    assert attacked.plc.shows("co2_setpoint") == HAND
    attacked.signal(signal.SIGTERM)
    assert attacked.ended() == 0
    assert attacked.plc.shows("co2_setpoint") == HAND
    last = attacked.log().rsplit("stopped:", 1)[1]
    assert "but for heating_setpoint, co2_setpoint, which a hand may have set" in last
    assert "Traceback" not in attacked.log()
