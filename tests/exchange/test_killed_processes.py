"""The real processes, killed with SIGKILL at random moments: the trainer's collector and the gateway's courier."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

from igrow.edge.exchange import Order
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World

ROOT = Path(__file__).resolve().parents[2]
COLLECT = "import sys; from igrow.trainer.cli import main; sys.exit(main(sys.argv[1:]))"


def killed_after(seconds: float, command: list[str], given: bytes = b"") -> int:
    """Run a command and kill it after some seconds; returns its exit status."""
    with subprocess.Popen(
        [sys.executable, *command], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
    ) as process:
        assert process.stdin is not None
        process.stdin.write(given)
        process.stdin.close()
        try:
            return process.wait(seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(4))
def test_killed_couriers_and_collectors_lose_nothing_and_repeat_nothing(seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    world = World(tmp_path)
    for day in range(30):
        world.log(START + day * DAY, START + (day + 1) * DAY, 3600)
    world.store.flush()
    end = START + 30 * DAY
    order = Order(str(world.outbox), str(world.store.folder), SITE, str(tmp_path / "exchange"), "0.1.0", end + 300)
    given = json.dumps(asdict(order)).encode()
    collect = ["-c", COLLECT, "collect", SITE, "--exchange", str(tmp_path / "exchange"), "--state", str(tmp_path)]
    killed = 0
    for _ in range(10):
        killed += killed_after(chance.uniform(0.2, 1.5), ["-m", "igrow.edge.exchange", str(os.getpid())], given) < 0
        killed += killed_after(chance.uniform(0.5, 3.0), collect) < 0
    assert killed > 3
    assert world.round(end + 600).problem == ""
    world.collect(end)
    assert world.round(end + 900).waiting == 0
    world.assert_complete()
    world.store.close()
