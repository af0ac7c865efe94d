"""The daemon's side: a courier does the work in a process of its own, and nothing that it meets holds anybody."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

from igrow.core.exchange import FolderPlace, SegmentName
from igrow.edge.exchange import ExchangeService
from igrow.edge.exchange.service import TransferRules
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from tests.patience import PATIENCE

DAY = 86_400
START = 20_500 * DAY


@pytest.fixture
def store(tmp_path: Path):
    made = SqliteStore(tmp_path / "store", StoreLimits(survive_power_cut=False))
    for hour in range(24):
        made.append(START + 3600 * hour, {"air_temperature": Value(20.0, Quality.GOOD, 0.0)})
    made.record_event(START + DAY, "test", {})
    yield made
    made.close()


def service(tmp_path: Path, store: SqliteStore, **rules: float) -> ExchangeService:
    return ExchangeService(
        str(tmp_path / "exchange"), tmp_path / "state", "greenhouse", store,
        igrow_version="0.1.0", rules=TransferRules(**rules),  # type: ignore[arg-type]
    )  # fmt: skip


def wait_until(done: Callable[[], object]) -> None:
    until = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < until
        time.sleep(0.02)


def tick(exchange: ExchangeService, now: float | None) -> None:
    """Let the service look at the time, and wait until it has: a tick itself waits for nobody."""
    exchange.tick(now)
    wait_until(lambda: not exchange._aside.waiting)


def finish(exchange: ExchangeService) -> None:
    """Wait for the end of the round that is under way."""

    def over() -> bool:
        exchange._reap()
        return not exchange.busy

    wait_until(over)


def test_a_day_that_is_over_is_sealed_and_sent_by_a_process_of_its_own(tmp_path: Path, store: SqliteStore) -> None:
    exchange = service(tmp_path, store)
    tick(exchange, START + DAY + 300)
    assert exchange.busy
    finish(exchange)
    assert exchange.health == ""
    (path,) = (tmp_path / "exchange" / "greenhouse" / "segments").iterdir()
    name = SegmentName.parse(path.name)
    assert name is not None and name.number == 1
    tick(exchange, START + DAY + 310)
    assert not exchange.busy, "nothing is due"
    exchange.close()


def test_without_a_true_clock_nothing_is_sealed_and_receipts_are_still_taken(
    tmp_path: Path, store: SqliteStore
) -> None:
    exchange = service(tmp_path, store)
    tick(exchange, None)
    finish(exchange)
    assert exchange.health == ""
    assert json.loads((tmp_path / "state" / "status.json").read_text())["sealed"] == 0
    exchange.close()


def test_what_a_clock_that_went_back_between_two_rounds_has_logged_arrives_too(
    tmp_path: Path, store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    # However slow this machine is, no round begins before its time has come.
    monkeypatch.setattr("igrow.edge.exchange.service.SOON_SECONDS", math.inf)
    exchange = service(tmp_path, store)
    tick(exchange, START + DAY + 300)
    finish(exchange)
    for second in range(0, 600, 60):
        moment = START + 5000.5 + second
        store.append(moment, {"air_temperature": Value(21.0, Quality.GOOD, 0.0)})
        tick(exchange, moment)
    store.append(START + DAY + 900, {"air_temperature": Value(20.0, Quality.GOOD, 0.0)})
    exchange._started = float("-inf")  # as if the time of the next round had come
    tick(exchange, START + DAY + 1200)
    finish(exchange)
    assert exchange.health == ""
    assert exchange._seen is None
    archive = Archive(tmp_path / "archive")
    collect(FolderPlace(tmp_path / "exchange"), "greenhouse", archive, datetime.fromtimestamp(START + 2 * DAY, UTC))
    assert len(archive.read("greenhouse", date(2026, 2, 16), date(2026, 2, 17)).telemetry) == 24 + 10
    exchange.close()


def test_a_report_is_sent_with_the_log_that_belongs_to_it(tmp_path: Path, store: SqliteStore) -> None:
    exchange = service(tmp_path, store)
    exchange.leave_report(START + DAY / 2, "a-adopted", {"verdict": "adopted"})
    tick(exchange, START + DAY / 2)
    finish(exchange)
    assert len(list((tmp_path / "exchange" / "greenhouse" / "reports").iterdir())) == 1
    assert len(list((tmp_path / "exchange" / "greenhouse" / "segments").iterdir())) == 1
    exchange.close()


def hang(tmp_path: Path) -> None:
    """Make the exchange hang whoever opens it: a pipe that nobody writes to stands where a receipt is read."""
    folder = tmp_path / "state" / "bundles" / "metadata"
    folder.mkdir(parents=True)
    os.mkfifo(folder / "timestamp.json")
    source = tmp_path / "exchange" / "greenhouse" / "bundles" / "metadata"
    source.mkdir(parents=True)
    (source / "timestamp.json").write_text("{}")


def test_an_exchange_that_hangs_holds_neither_a_tick_nor_the_stop(tmp_path: Path, store: SqliteStore) -> None:
    hang(tmp_path)
    exchange = service(tmp_path, store, deadline=PATIENCE)
    tick(exchange, START + DAY + 300)
    # What comes before the hang is done.
    wait_until(lambda: list((tmp_path / "exchange" / "greenhouse").glob("segments/*.zip")))
    for _ in range(20):
        tick(exchange, START + DAY + 300)
        assert exchange.busy
    courier = exchange._process
    assert courier is not None
    exchange.close()
    courier.wait(PATIENCE)  # a round that hangs is ended by the stop


def test_a_round_that_hangs_is_ended_and_told(tmp_path: Path, store: SqliteStore) -> None:
    hang(tmp_path)
    exchange = service(tmp_path, store, deadline=1.0)
    tick(exchange, START + DAY + 300)
    finish(exchange)
    assert "no end within 1 s" in exchange.health
    exchange.close()


def test_a_stop_seals_what_there_is_of_the_day(
    tmp_path: Path, store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("igrow.edge.exchange.service.CLOSING_SECONDS", PATIENCE)
    exchange = service(tmp_path, store)
    tick(exchange, START + DAY / 2)
    finish(exchange)
    assert not (tmp_path / "exchange" / "greenhouse").exists()
    tick(exchange, START + DAY / 2 + 60)
    exchange.close()
    status = json.loads((tmp_path / "state" / "status.json").read_text())
    assert status["problem"] == ""
    assert len(list((tmp_path / "exchange" / "greenhouse" / "segments").iterdir())) == 1
