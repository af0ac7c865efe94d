"""The disk or share of the exchange goes while the gateway runs, and comes back: nothing is left in its mount point."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from igrow.core.exchange import FolderPlace
from igrow.edge.exchange.outbox import REPORTS
from tests import needs
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World


def test_an_exchange_that_is_unmounted_and_comes_back_gets_everything(tmp_path: Path) -> None:
    """In a mount namespace of its own, in which /mnt is the share."""
    needs.mount_namespace()
    done = subprocess.run(
        ["unshare", "-m", sys.executable, __file__, str(tmp_path)],
        check=False, capture_output=True, text=True, cwd=needs.ROOT, env={**os.environ, "PYTHONPATH": str(needs.ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "ok\n"


def mount(*arguments: str) -> None:
    subprocess.run(arguments, check=True)


def report(world: World, name: str) -> None:
    reports = world.outbox / REPORTS
    reports.mkdir(parents=True, exist_ok=True)
    (reports / f"{name}.json").write_text(json.dumps({"name": name}))


def unmounted_and_back(folder: Path) -> None:
    share, kept = Path("/mnt"), folder / "share"
    kept.mkdir()
    # Two file systems: the gateway's own disk below /mnt, and the share over it.
    mount("mount", "--bind", str(folder), "/mnt")
    mount("mount", "-t", "tmpfs", "share", str(kept))
    mount("mount", "--bind", str(kept), "/mnt")
    world = World(folder / "gateway", FolderPlace(share / "exchange"))
    world.log(START, START + DAY)
    assert world.round(START + 1.1 * DAY).problem == ""
    world.log(START + DAY, START + 2 * DAY)
    report(world, "worse")
    mount("umount", "/mnt")
    assert "not mounted" in world.round(START + 2.1 * DAY).problem
    assert "not mounted" in world.round(START + 2.2 * DAY).problem
    assert not (share / "exchange").exists()
    mount("mount", "--bind", str(kept), "/mnt")
    status = world.round(START + 2.3 * DAY)
    assert status.problem == ""
    assert status.sent == 1
    assert [path.name for path in (share / "exchange" / SITE / "reports").iterdir()] == ["worse.json"]
    assert len(list((share / "exchange" / SITE / "segments").iterdir())) == 2
    world.collect(START + 3 * DAY)
    assert world.archived() == world.logged


if __name__ == "__main__":
    unmounted_and_back(Path(sys.argv[1]))
    print("ok")
