"""One daemon at a time on a state folder, whatever became of the one before."""

from __future__ import annotations

import contextlib
import subprocess
from pathlib import Path

from tests.service.running_daemon import COMMAND, RunningDaemon


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
