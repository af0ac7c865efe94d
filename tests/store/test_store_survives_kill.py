"""`kill -9` at any instant costs at most the last batch of telemetry and never an event."""

from __future__ import annotations

import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from igrow.edge.store import SqliteStore
from tests.store.store_helpers import START, number_of

BATCH_ROWS = 11
"""50 s of rows every 5 s, and the row that closes the batch."""


def kill_at_random(folder: Path, rng: random.Random) -> tuple[int, int]:
    """Run the writing child, kill it at a random instant; return the rows and events that it had acknowledged."""
    script = Path(__file__).with_name("store_helpers.py")
    child = subprocess.Popen(
        [sys.executable, str(script), str(folder)], stdout=subprocess.PIPE, cwd=Path(__file__).parents[2]
    )
    assert child.stdout is not None
    first = child.stdout.readline().split()
    assert first[:1] == [b"open"], "the child must start again by itself after each kill"
    rows, events = int(first[1]), int(first[2])
    time.sleep(rng.random() ** 2 * 0.15)
    child.kill()
    rest, _ = child.communicate()
    complete = rest[: rest.rfind(b"\n") + 1].splitlines()
    for line in complete:
        what, number = line.split()
        if what == b"row":
            rows = int(number)
        else:
            events = int(number)
    return rows, events


def check_nothing_dear_is_lost(folder: Path, rows: int, events: int) -> None:
    store = SqliteStore(folder)
    telemetry = store.telemetry(0.0, 8e9)
    # One more than acknowledged may be there: the kill can fall between the commit and the acknowledgement.
    assert rows - BATCH_ROWS <= len(telemetry) <= rows + 1
    found = (telemetry.time.astype("int64") - int(START)) // 5
    assert found.tolist() == list(range(len(telemetry)))
    numbers = [number_of(record) for record in store.records("event", 10**9)][::-1]
    assert numbers == list(range(len(numbers)))
    assert events <= len(numbers) <= events + 1
    assert store.health == ""
    store.close()


def kill_repeatedly(folder: Path, times: int, seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(times):
        rows, events = kill_at_random(folder, rng)
        check_nothing_dear_is_lost(folder, rows, events)


def test_ten_kills_lose_at_most_the_last_batch_and_no_event(tmp_path: Path) -> None:
    kill_repeatedly(tmp_path, 10, seed=1)


@pytest.mark.soak
def test_two_hundred_kills_lose_at_most_the_last_batch_and_no_event(tmp_path: Path) -> None:
    kill_repeatedly(tmp_path, 200, seed=2)
