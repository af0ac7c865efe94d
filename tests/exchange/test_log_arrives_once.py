"""Whatever is repeated, cut off, reordered or lost between gateway and trainer: each row arrives, and arrives once."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime
from pathlib import Path

import duckdb
import numpy as np
import pytest

from igrow.core.exchange import ExchangeError, FolderPlace, SegmentName
from igrow.trainer.service.collecting import collect
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World


def test_each_day_is_sealed_sent_collected_receipted_and_forgotten(world: World) -> None:
    world.run_days(0, 3)
    assert len(world.waiting()) == 3
    done = world.collect(START + 3 * DAY)
    assert (done.segments, done.rows, done.notes) == (3, 432, [])
    assert world.place.entries(f"{SITE}/segments") == []
    status = world.round(START + 3 * DAY + 600)
    assert (status.receipted, status.waiting) == (3, 0)
    world.assert_complete()


def test_a_second_delivery_changes_nothing(world: World, tmp_path: Path) -> None:
    world.run_days(0, 3)
    shutil.copytree(tmp_path / "exchange", tmp_path / "copy")
    world.collect(START + 3 * DAY)
    again = world.collect(START + 3 * DAY, FolderPlace(tmp_path / "copy"))
    assert (again.segments, again.bytes) == (0, 0)
    (tmp_path / "archive" / "ledger" / f"{SITE}.json").unlink()
    shutil.copytree(tmp_path / "copy", tmp_path / "exchange", dirs_exist_ok=True)
    world.run_days(3, 4)
    world.collect(START + 4 * DAY)
    world.assert_complete()


def test_any_order_of_arrival_gives_the_same_archive(world: World, tmp_path: Path) -> None:
    world.run_days(0, 5)
    names = world.waiting()
    for name in (names[3], names[0], names[4], names[2], names[1]):
        place = FolderPlace(tmp_path / "one")
        place.put(f"{SITE}/segments/{name}", (world.outbox / "segments" / name).read_bytes())
        world.collect(START + 5 * DAY, place)
    world.assert_complete()
    receipt = json.loads((tmp_path / "one" / SITE / "receipts" / f"{names[0][:12]}.json").read_text())
    assert (receipt["through"], receipt["beyond"]) == (5, {})


def test_missing_days_are_named_until_they_come(world: World, tmp_path: Path) -> None:
    world.run_days(0, 4)
    names = [str(SegmentName.parse(entry.name)) for entry in world.place.entries(f"{SITE}/segments")]
    held_back = tmp_path / "exchange" / SITE / "segments" / names[1]
    content = held_back.read_bytes()
    held_back.unlink()
    assert world.collect(START + 4 * DAY).notes == ["segment 2 has not come yet, 2026-02-17 to 2026-02-18"]
    held_back.write_bytes(content)
    assert world.collect(START + 4 * DAY).notes == []
    world.assert_complete()


def test_a_cut_or_altered_segment_is_sent_again(world: World, tmp_path: Path) -> None:
    world.run_days(0, 2)
    first, second = sorted((tmp_path / "exchange" / SITE / "segments").iterdir())
    first.write_bytes(first.read_bytes()[:-100])
    second.write_bytes(second.read_bytes().replace(b"seal", b"sea1"))
    notes = world.collect(START + 2 * DAY).notes
    assert len(notes) == 2
    assert all("sends it again" in note for note in notes)
    world.round(START + 2 * DAY + 900)
    world.collect(START + 2 * DAY)
    world.assert_complete()


def test_a_gateway_that_is_offline_for_months_keeps_its_budget_and_says_what_it_gave_up(tmp_path: Path) -> None:
    world = World(tmp_path, budget=20_000)

    class Away(FolderPlace):
        def get(self, path: str, largest: int) -> bytes | None:
            raise ExchangeError("no route to host")

    for day in range(40):
        world.log(START + day * DAY, START + (day + 1) * DAY)
        status = world.round(START + (day + 1) * DAY + 300, place=Away(tmp_path))
        assert status.waiting_bytes <= 20_000
        assert "no route to host" in status.problem
    world.run_days(40, 41)
    notes = world.collect(START + 41 * DAY).notes
    given_up = 41 - len(world.archived()) // 144
    assert 0 < given_up < 41
    assert any("were deleted on the gateway" in note and f" {given_up} " in note for note in notes), notes
    assert max(world.archived()) == max(world.logged)
    world.store.close()


def test_a_lost_outbox_state_seals_again_and_the_archive_has_nothing_twice(world: World) -> None:
    world.run_days(0, 2)
    world.collect(START + 2 * DAY)
    shutil.rmtree(world.outbox)
    world.run_days(2, 4)
    world.collect(START + 4 * DAY)
    world.assert_complete()


def test_a_power_cut_between_segment_and_state_seals_nothing_twice(world: World) -> None:
    world.run_days(0, 1)
    before = (world.outbox / "chain.json").read_bytes()
    world.run_days(1, 2)
    (world.outbox / "chain.json").write_bytes(before)
    world.run_days(2, 3)
    waiting = [SegmentName.parse(name) for name in world.waiting()]
    assert [name and name.number for name in waiting] == [1, 2, 3]
    assert world.collect(START + 3 * DAY).notes == []
    world.assert_complete()


def test_a_gateway_restored_from_a_backup_begins_another_chain(world: World, tmp_path: Path) -> None:
    world.run_days(0, 1)
    shutil.copytree(world.outbox, tmp_path / "backup")
    world.run_days(1, 3)
    world.collect(START + 3 * DAY)
    shutil.rmtree(world.outbox)
    shutil.copytree(tmp_path / "backup", world.outbox)
    world.run_days(3, 5)
    world.run_days(5, 6)
    world.collect(START + 6 * DAY)
    world.round(START + 6 * DAY + 600)
    world.assert_complete()
    assert world.waiting() == []


def test_a_site_reads_no_segment_that_another_has_sealed(world: World, tmp_path: Path) -> None:
    world.run_days(0, 1)
    shutil.copytree(tmp_path / "exchange" / SITE, tmp_path / "exchange" / "other")
    done = collect(world.place, "other", world.archive, datetime(2026, 6, 1, tzinfo=UTC))
    assert "sealed by site greenhouse" in done.notes[0]
    assert len(list((tmp_path / "archive" / "refused" / "other").iterdir())) == 1


def test_duckdb_and_pandas_read_the_archive_without_us(world: World, tmp_path: Path) -> None:
    import pandas as pd

    world.run_days(0, 2)
    world.collect(START + 2 * DAY)
    files = f"{tmp_path}/archive/telemetry/**/*.parquet"
    found = duckdb.sql(
        "select site, month, count(*), max(air_temperature) "
        f"from read_parquet('{files}', hive_partitioning=true) group by all"
    )
    assert found is not None
    (row,) = found.fetchall()
    assert row[:3] == (SITE, "2026-02", 288)
    assert row[3] == pytest.approx(max(world.logged.values()))
    frame = pd.read_parquet(tmp_path / "archive" / "telemetry")
    assert len(frame) == 288
    assert np.isclose(frame["air_temperature"].max(), max(world.logged.values()))
