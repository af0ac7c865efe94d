"""A daemon whose state folder is on a disk that is full from the beginning controls, and keeps its log once it can."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import pytest

from igrow.edge.daemon import Daemon
from igrow.edge.store import read_records, read_telemetry
from tests import needs
from tests.control.daemon_bench import Plant, free_port, running, until, write_files


@pytest.mark.parametrize("state", ["new", "there"])
def test_a_daemon_starts_on_a_full_disk_and_keeps_what_it_logs_until_there_is_room(tmp_path: Path, state: str) -> None:
    """In a mount namespace of its own, in which /mnt is a disk of 8 MB."""
    needs.mount_namespace()
    command = f"mount -t tmpfs -o size=8M small /mnt && exec {sys.executable} {__file__} {tmp_path} {state}"
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", command],
        check=False, capture_output=True, text=True, cwd=needs.ROOT, env={**os.environ, "PYTHONPATH": str(needs.ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout == "ok\n"


def fill(ballast: Path) -> None:
    with ballast.open("wb", buffering=0) as stream:
        try:
            while True:
                stream.write(bytes(512))
        except OSError:
            pass


def events(folder: Path) -> list[str]:
    return [str(record.body["kind"]) for record in read_records(folder, "event")]


def alarms(daemon: Daemon) -> set[str]:
    return {alarm.name for alarm in daemon._journal.alarms.active}


async def starts_on_a_full_disk(folder: Path, state: str) -> None:
    port = free_port()
    path = write_files(folder, port)
    path.write_text(path.read_text().replace("state: state", "state: /mnt/state"))
    ballast, store = Path("/mnt/ballast"), Path("/mnt/state/store")
    plant = Plant(folder, port)
    await plant.up()
    if state == "there":
        async with running(path) as daemon:
            await until(lambda: daemon.cycles > 5)
    fill(ballast)
    async with running(path) as daemon:
        await until(lambda: daemon.cycles > 30)
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
        assert daemon.services.store.health, "nobody says that the disk is full"
        await asyncio.to_thread(ballast.unlink)
        await until(lambda: not daemon.services.store.health)
        assert not {name for name in alarms(daemon) if name.startswith("service")}
        cycles = daemon.cycles
        await until(lambda: daemon.cycles > cycles + 5)
    await plant.down()
    assert events(store).count("started") == (2 if state == "there" else 1)
    assert len(read_telemetry(store, 0.0, 4e9)) > 30


if __name__ == "__main__":
    asyncio.run(starts_on_a_full_disk(Path(sys.argv[1]), sys.argv[2]))
    print("ok")
