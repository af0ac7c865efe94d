"""Two gateways of one name, a cloned memory card, receipts of somebody else: nothing is lost, and people are told."""

from __future__ import annotations

import json
import shutil
from datetime import date
from pathlib import Path

import pytest

from igrow.core.exchange import FolderPlace
from igrow.edge.store import SqliteStore, StoreLimits
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World


def other_gateway(world: World, folder: Path) -> World:
    """Return another gateway at the same exchange and archive."""
    other = World(folder, world.place)
    other.archive = world.archive
    return other


def cloned(world: World, folder: Path) -> World:
    """Return a gateway that has begun as a copy of this one's memory card."""
    world.store.close()
    shutil.copytree(world.folder / "store", folder / "store")
    shutil.copytree(world.folder / "state", folder / "state")
    world.store = SqliteStore(world.folder / "store", StoreLimits(survive_power_cut=False))
    other = other_gateway(world, folder)
    other.logged = dict(world.logged)
    return other


def chains(world: World) -> set[str]:
    return {
        chain["chain"] for chain in json.loads((world.archive.root / "ledger" / f"{SITE}.json").read_text())["chains"]
    }


@pytest.mark.parametrize("way", ["cloned", "same name"])
def test_two_gateways_of_one_name_are_told_and_neither_loses_a_row_nor_sends_for_ever(
    world: World, tmp_path: Path, way: str
) -> None:
    world.run_days(0, 2)
    world.collect(START + 2 * DAY)
    world.round(START + 2 * DAY + 900)
    other = cloned(world, tmp_path / "other") if way == "cloned" else other_gateway(world, tmp_path / "other")
    notes: list[str] = []
    sent: list[int] = []
    for day in range(2, 10):
        world.run_days(day, day + 1)
        begin = START + day * DAY
        other.log(begin + 60, begin + DAY, value=35.0)  # it has a clock and sensors of its own
        other.round(begin + DAY + 400)
        done = world.collect(begin + DAY + 500)
        notes += done.notes
        sent.append(done.segments)
        world.round(begin + DAY + 900)
        other.round(begin + DAY + 900)
    assert sent[-3:] == [2, 2, 2], sent
    assert len(chains(world)) <= 3
    assert any(f"do two gateways call themselves {SITE}?" in note for note in notes), notes
    table = world.archive.read(SITE, date(2026, 2, 16), date(2026, 2, 26)).telemetry
    have = {int(time) for time in table.time.astype("int64")}
    assert world.logged.keys() <= have
    assert other.logged.keys() <= have


def test_a_receipt_of_another_site_or_chain_makes_nobody_forget(world: World, tmp_path: Path) -> None:
    there = World(tmp_path / "there", FolderPlace(tmp_path / "elsewhere"))
    there.run_days(0, 3)
    there.collect(START + 3 * DAY)
    (receipt,) = (tmp_path / "elsewhere" / SITE / "receipts").iterdir()
    world.run_days(0, 2)
    mine = json.loads((world.outbox / "chain.json").read_text())["chain"]
    for name in (receipt.name, f"{mine}.json"):
        world.place.put(f"{SITE}/receipts/{name}", receipt.read_bytes())
    assert world.round(START + 2 * DAY + 900).waiting == 2
    world.run_days(2, 3)
    world.collect(START + 3 * DAY)
    world.assert_complete()
