"""The order of the tests: each worker begins with its part of what takes long, and none is lost."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import conftest

TESTS = Path(conftest.__file__).parent


def collected(**files: int) -> list[SimpleNamespace]:
    """So many tests of each file, named folder__file."""
    paths = {TESTS / Path(*name.split("__")): count for name, count in files.items()}
    return [SimpleNamespace(path=path, number=number) for path, count in paths.items() for number in range(count)]


def begins(items: list[SimpleNamespace], workers: int) -> list[str]:
    """The file that each worker begins with."""
    return [items[worker * len(items) // workers].path.name for worker in range(workers)]


def test_every_worker_begins_with_what_takes_long_and_does_a_file_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    items = collected(bus__a=50, core__b=20, diagnosis__c=3, fit__d=4, service__e=5, updates__f=1, fleet__g=1)
    before = {(one.path, one.number) for one in items}
    monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", "4")
    conftest.pytest_collection_modifyitems(items)  # type: ignore[arg-type]
    assert begins(items, 4) == ["c", "e", "d", "g"]
    assert {(one.path, one.number) for one in items} == before
    assert [one.number for one in items if one.path.name == "d"] == [0, 1, 2, 3]


def test_where_all_takes_long_none_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    items = collected(diagnosis__a=9, fit__b=1)
    monkeypatch.setenv("PYTEST_XDIST_WORKER_COUNT", "4")
    conftest.pytest_collection_modifyitems(items)  # type: ignore[arg-type]
    assert [one.path.name for one in items] == ["a"] * 9 + ["b"]


def test_the_folders_that_take_long_are_there() -> None:
    assert {path.name for path in TESTS.iterdir() if path.is_dir()} >= {*conftest.COMPUTING, *conftest.WAITING}
