"""A benchmark that is cut short goes on; its digits depend neither on that nor on how many workers it has."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.jobs import CLUSTER, Jobs
from igrow.trainer.fleet import calls
from igrow.trainer.fleet.registry import Backend
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Task, TaskOutcome


def digits(job: tuple[int, str]) -> tuple[int, Any]:
    """Return digits that depend on every one before them, and leave a mark; a job whose stop is there fails."""
    seed, folder = job
    if (Path(folder) / f"stop-{seed}").exists():
        raise ValueError(f"job {seed} was stopped")
    with (Path(folder) / "marks").open("a") as file:
        file.write(f"{seed}\n")
    return seed, np.linalg.svd(np.random.default_rng(seed).normal(size=(60, 60)))[1]


def marks(folder: Path) -> list[int]:
    return sorted(map(int, (folder / "marks").read_text().split()))


def test_one_failure_leaves_the_others_and_a_second_run_does_only_what_was_not_done(tmp_path: Path) -> None:
    wanted = [(seed, str(tmp_path)) for seed in range(6)]
    (tmp_path / "stop-2").touch()
    with pytest.raises(RuntimeError, match=r"1 of 6 jobs failed.*job 2 was stopped"), Jobs("x", 2, tmp_path) as jobs:
        list(jobs.each(digits, wanted))
    assert marks(tmp_path) == [0, 1, 3, 4, 5]
    (tmp_path / "stop-2").unlink()
    with Jobs("x", 2, tmp_path) as jobs:
        found = list(jobs.each(digits, wanted))
    assert marks(tmp_path) == [0, 1, 2, 3, 4, 5], "nothing was done twice"
    assert [seed for seed, _ in found] == list(range(6)), "in the order of the jobs"
    assert not (tmp_path / "x").exists(), "a command that ended well forgets what it kept"


def test_one_worker_gives_the_digits_of_two(tmp_path: Path) -> None:
    wanted = [(seed, str(tmp_path)) for seed in range(6)]
    found = []
    for workers in (1, 2):
        with Jobs("x", workers, tmp_path) as jobs:
            found.append(list(jobs.each(digits, wanted)))
    for (one, first), (two, second) in zip(*found, strict=True):
        assert one == two
        np.testing.assert_array_equal(first, second)


def test_a_cluster_that_is_named_gets_the_same_tasks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[Backend, str | None]] = []

    def noted(tasks: Sequence[Task], backend: Backend, *, workers: int, address: str | None) -> Iterator[TaskOutcome]:
        asked.append((backend, address))
        return run_tasks(tasks, workers=workers)

    monkeypatch.setattr(calls, "run_tasks", noted)
    found = []
    for cluster in ("", "local", "ray://head:10001"):
        monkeypatch.setenv(CLUSTER, cluster)
        with Jobs("x", 2, tmp_path) as jobs:
            found.append([seed for seed, _ in jobs.each(digits, [(0, str(tmp_path)), (1, str(tmp_path))])])
    assert asked == [(Backend.PROCESSES, None), (Backend.RAY, None), (Backend.RAY, "ray://head:10001")]
    assert found == 3 * [[0, 1]]


def test_what_was_kept_for_another_job_does_not_count(tmp_path: Path) -> None:
    (tmp_path / "stop-1").touch()
    with pytest.raises(RuntimeError), Jobs("x", 1, tmp_path) as jobs:
        list(jobs.each(digits, [(0, str(tmp_path)), (1, str(tmp_path))]))
    with Jobs("x", 1, tmp_path) as jobs:
        assert [seed for seed, _ in jobs.each(digits, [(7, str(tmp_path)), (0, str(tmp_path))])] == [7, 0]
    assert marks(tmp_path) == [0, 7]
