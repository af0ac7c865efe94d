"""`kill -9` of the whole daemon at random instants: it starts again by itself and nothing dear is lost."""

from __future__ import annotations

import random
import time
from pathlib import Path

import numpy as np
import pytest

from igrow.edge.store import read_records, read_telemetry
from tests.service.running_daemon import INTERVAL, RunningDaemon

LOST_ROWS = 13
"""Rows of one batch: on a simulated plant it spans an hour of the plant's time, a row every 300 s."""


def kinds(plant: RunningDaemon) -> list[str]:
    return [str(record.body["kind"]) for record in reversed(read_records(plant.state / "store", "event"))]


def rows_of(plant: RunningDaemon) -> int:
    """Return the number of committed rows."""
    if not (plant.state / "store" / "telemetry.db").exists():
        return 0
    return len(read_telemetry(plant.state / "store", 0.0, 8e9))


def kill_repeatedly(folder: Path, times: int, seed: int) -> None:
    """Start, kill at a random instant, and check after each kill what is on the disk."""
    rng = random.Random(seed)
    plant = RunningDaemon(folder)
    rows = 0
    sequences: list[int] = []
    try:
        began = time.monotonic()
        plant.start()
        plant.wait_for(lambda: rows_of(plant) > 20)
        span = 1.5 * (time.monotonic() - began)
        plant.kill()
        for number in range(times):
            plant.start()
            # From the first imports, through the start, to the middle of many cycles, however busy this machine is.
            time.sleep(rng.random() * span)
            plant.kill()
            now = sorted(record.sequence for record in read_records(plant.state / "store", "event"))
            assert now[: len(sequences)] == sequences, f"kill {number}: an event that was there is gone"
            sequences = now
            found = rows_of(plant)
            assert found >= rows, f"kill {number}: rows that were there are gone"
            rows = found
        plant.start()
        plant.wait_for(lambda: "started" in kinds(plant)[len(sequences) :])
        plant.wait_for(lambda: rows_of(plant) > rows + 20)
        assert plant.stop() == 0
        telemetry = read_telemetry(plant.state / "store", 0.0, 8e9)
        gaps = np.diff(telemetry.time).astype(int) // INTERVAL - 1
        # Each kill costs the rows of its batch; the plant itself waits while nobody controls it.
        assert gaps.max(initial=0) <= LOST_ROWS
        assert "store_repaired" not in kinds(plant)
    finally:
        plant.close()


def test_five_kills_of_the_daemon_cost_at_most_one_batch_each(tmp_path: Path) -> None:
    kill_repeatedly(tmp_path, 5, seed=3)


@pytest.mark.soak
def test_two_hundred_kills_of_the_daemon_cost_at_most_one_batch_each(tmp_path: Path) -> None:
    kill_repeatedly(tmp_path, 200, seed=4)
