"""One daemon at a time on a state folder, whatever became of the one before."""

from __future__ import annotations

import contextlib
import itertools
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from igrow.edge.state_lock import LOCK_FILE, StateLock
from tests.service.attacked_daemon import SAFE, AttackedDaemon
from tests.service.running_daemon import COMMAND, RunningDaemon


@pytest.fixture
def attacked(tmp_path: Path) -> Iterator[AttackedDaemon]:
    daemon = AttackedDaemon(tmp_path)
    yield daemon
    daemon.close()


def command(plant: RunningDaemon, name: str, *arguments: object) -> tuple[int, str]:
    done = subprocess.run(
        [*COMMAND, name, str(plant.configuration), *map(str, arguments)], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stderr


def couriers_of(plant: RunningDaemon) -> list[Path]:
    """The processes of the exchange that a daemon has started and that are still there."""
    assert plant.daemon is not None
    order = b"\0".join((b"igrow.edge.exchange", str(plant.daemon.pid).encode()))
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if order in (process / "cmdline").read_bytes():
                found.append(process)
    return found


def test_a_second_daemon_and_a_restore_are_refused_until_the_first_is_gone(tmp_path: Path) -> None:
    plant = RunningDaemon(tmp_path)
    archive = tmp_path / "backup.tar.gz"
    try:
        plant.start()
        plant.wait_for((plant.state / "status.json").exists)
        assert command(plant, "backup", archive)[0] == 0
        for name, *arguments in (("run",), ("restore", archive)):
            code, said = command(plant, name, *arguments)
            assert code == 2
            assert "a daemon is running on it" in said
            assert said.count("\n") == 1
        plant.kill()
        plant.wait_for(lambda: not couriers_of(plant))
        plant.state.rename(plant.state.with_name("old"))
        assert command(plant, "restore", archive) == (0, "")
        plant.start()
        plant.wait_for((plant.state / "status.json").exists)
        assert plant.stop() == 0
    finally:
        plant.close()


def removed(state: Path) -> None:
    moved_away(state)
    shutil.rmtree(state.with_name("away"), ignore_errors=True)


def lock_removed(state: Path) -> None:
    (state / LOCK_FILE).unlink()


def moved_away(state: Path) -> None:
    state.rename(state.with_name("away"))


def replaced_by_a_copy(state: Path) -> None:
    """As by a restore that was made by hand."""
    # A file that the daemon is just writing may be whole, and under its own name, before it is copied.
    copy = shutil.copytree(state, state.with_name("copy"), ignore=shutil.ignore_patterns("*.part"))
    for number in itertools.count():
        state.rename(state.with_name(f"away{number}"))
        # In between the daemon may have made the folder anew, and written into it.
        with contextlib.suppress(OSError):
            copy.rename(state)
            return


@pytest.mark.parametrize("what", [removed, lock_removed, moved_away, replaced_by_a_copy])
def test_a_daemon_whose_state_folder_was_taken_away_keeps_a_second_one_out(
    attacked: AttackedDaemon, what: Callable[[Path], None]
) -> None:
    attacked.start()
    attacked.controls()
    what(attacked.state)
    attacked.until(lambda: "and its lock with it" in attacked.log())
    attacked.beats(2)
    second = subprocess.run(
        [*COMMAND, "run", str(attacked.configuration)], capture_output=True, text=True, check=False, timeout=60.0
    )
    assert second.returncode == 2
    assert "a daemon is running on it" in second.stderr
    attacked.beats(2)


@pytest.mark.parametrize("by", [None, signal.SIGTERM])
def test_a_daemon_whose_state_folder_another_one_has_leaves_the_plc_to_it(
    attacked: AttackedDaemon, by: int | None
) -> None:
    """It was quicker than the cycle in which the first one would have taken the lock of the new folder."""
    attacked.start()
    attacked.controls()
    attacked.beats(3)
    other = StateLock(attacked.folder / "other")
    other.hold()
    attacked.state.rename(attacked.folder / "away")
    (attacked.folder / "other").rename(attacked.state)
    written = len(attacked.plc.received)
    if by is not None:
        attacked.signal(by)
    assert attacked.ended() == 2
    other.let_go()
    assert not {value for name, value in attacked.plc.written(written) if value == SAFE[name]}
    (last,) = [line for line in attacked.log().splitlines() if line.startswith("error: ")]
    assert "another daemon has what is there now: this one ends" in last
    assert "Traceback" not in attacked.log()
    assert not (attacked.state / "store").exists()
