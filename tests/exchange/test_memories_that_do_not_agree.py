"""A trainer or gateway that remembers less than it did, another trainer, another name: the log arrives whole, once."""

from __future__ import annotations

import json
import shutil
from datetime import date
from pathlib import Path

import pytest

from igrow.core.errors import IgrowError
from igrow.core.exchange import Entry, ExchangeError, FolderPlace, Seal, pack_segment
from igrow.core.telemetry import concatenate
from igrow.edge.exchange.courier import mirror
from igrow.trainer.cli import main
from igrow.trainer.publishing import create_keys, publish_in, refresh
from igrow.trainer.service.archive import Archive
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World
from tests.tiny_bundle import write_tiny_bundle


def go_on(world: World, first: int) -> list[str]:
    """Let four days pass with rounds and collections; returns what the last collection says."""
    notes = ["none was made"]
    for day in range(first, first + 4):
        world.run_days(day, day + 1)
        notes = world.collect(START + (day + 1) * DAY).notes
        world.round(START + (day + 1) * DAY + 900)
    return notes


def test_a_trainer_restored_from_an_older_backup_gets_again_what_it_has_lost(world: World, tmp_path: Path) -> None:
    world.run_days(0, 2)
    world.collect(START + 2 * DAY)
    shutil.copytree(tmp_path / "archive", tmp_path / "backup")
    world.run_days(2, 4)
    world.collect(START + 4 * DAY)
    assert world.round(START + 4 * DAY + 900).waiting == 0
    shutil.rmtree(tmp_path / "archive")
    shutil.copytree(tmp_path / "backup", tmp_path / "archive")
    assert go_on(world, 4) == []
    world.assert_complete()


def test_a_trainer_that_lost_its_archive_gets_what_the_gateways_log_has(world: World, tmp_path: Path) -> None:
    world.run_days(0, 3)
    world.collect(START + 3 * DAY)
    world.round(START + 3 * DAY + 900)
    shutil.rmtree(tmp_path / "archive")
    with pytest.raises(IgrowError, match="--take-over"):
        world.collect(START + 3 * DAY)
    world.collect(START + 3 * DAY, take_over=True)
    assert go_on(world, 3) == []
    world.assert_complete()


@pytest.mark.parametrize("kind", ["telemetry", "events"])
def test_a_damaged_day_says_how_it_is_mended_and_comes_again(
    world: World, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    world.run_days(0, 3)
    world.collect(START + 3 * DAY)
    world.round(START + 3 * DAY + 900)
    (day, *_) = sorted((tmp_path / "archive" / kind / f"site={SITE}").rglob("*.parquet"))
    whole = day.read_bytes()
    day.write_bytes(whole[: len(whole) // 2])
    (note,) = world.archive.read(SITE, date(2026, 2, 16), date(2026, 2, 19)).notes
    assert "`igrow-trainer collect SITE --again`" in note
    assert main(["collect", SITE, "--exchange", str(tmp_path / "exchange"), "--state", str(tmp_path), "--again"]) == 0
    assert "could not be read, and is set aside" in capsys.readouterr().out
    assert go_on(world, 3) == []
    world.assert_complete()
    assert day.with_suffix(".damaged").read_bytes() == whole[: len(whole) // 2]


def test_a_site_that_nobody_has_heard_of_is_an_error_and_leaves_nothing(
    world: World, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world.run_days(0, 1)
    arguments = ["--exchange", str(tmp_path / "exchange"), "--state", str(tmp_path / "new")]
    assert main(["collect", f"{SITE}x", *arguments]) == 1
    said = capsys.readouterr().out
    assert said.startswith(f"{SITE}x: error; neither ")
    assert said.endswith(f"has anything of it; known: {SITE}\n")
    assert not (tmp_path / "exchange" / f"{SITE}x").exists()
    assert main(["collect", SITE, *arguments]) == 0


def test_a_second_trainer_is_told_so_and_takes_nothing(world: World, tmp_path: Path, capsys) -> None:
    world.run_days(0, 1)
    world.collect(START + DAY)
    world.run_days(1, 2)
    arguments = ["collect", SITE, "--exchange", str(tmp_path / "exchange"), "--state", str(tmp_path / "second")]
    assert main(arguments) == 1
    assert "another archive collects it here since 2026-02-17" in capsys.readouterr().out
    assert len(world.place.entries(f"{SITE}/segments")) == 2 - 1
    world.collect(START + 2 * DAY)
    world.assert_complete()
    assert main([*arguments, "--take-over"]) == 0
    with pytest.raises(IgrowError, match="another archive"):
        world.collect(START + 3 * DAY)


def test_a_claim_that_was_cut_short_is_written_again(world: World, tmp_path: Path) -> None:
    world.run_days(0, 1)
    (tmp_path / "exchange" / SITE / "collector.json").write_text('{"archive": "ab')
    world.collect(START + DAY)
    world.assert_complete()
    assert "archive" in json.loads((tmp_path / "exchange" / SITE / "collector.json").read_text())


def test_an_outbox_restored_before_anything_was_collected_seals_what_a_clock_left_behind_again(
    world: World, tmp_path: Path
) -> None:
    world.run_days(0, 2)
    shutil.copytree(world.outbox, tmp_path / "backup")
    world.log(START + 5000, START + 6000, 301)
    world.seen = (START + 5000.0, START + 6000.0)
    world.round(START + 2 * DAY + 900, place=FolderPlace(tmp_path / "elsewhere"))
    shutil.rmtree(world.outbox)
    shutil.copytree(tmp_path / "backup", world.outbox)
    assert go_on(world, 2) == []
    world.assert_complete()


@pytest.mark.parametrize("waiting", [False, True])
def test_a_renamed_site_sends_its_whole_log_under_the_new_name(world: World, *, waiting: bool) -> None:
    world.run_days(0, 2)
    if not waiting:
        world.collect(START + 2 * DAY)
        world.round(START + 2 * DAY + 900)
    world.site = "greenhouse-north"
    assert go_on(world, 2) == []
    world.assert_complete()
    assert world.waiting() == []


def test_a_renaming_that_was_cut_off_in_the_middle_loses_nothing(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from igrow.edge.exchange.outbox import Outbox

    world.run_days(0, 3)
    (tmp_path / "store" / "telemetry.db").rename(tmp_path / "worn.db")  # only the outbox has these days
    world.site, seal, left = "greenhouse-north", Outbox.seal, [1]

    def seal_one(*arguments: object, **named: object) -> object:
        if not left:
            raise KeyboardInterrupt
        left.pop()
        return seal(*arguments, **named)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Outbox, "seal", seal_one)
        with pytest.raises(KeyboardInterrupt):
            world.round(START + 3 * DAY + 600)
    (tmp_path / "worn.db").rename(tmp_path / "store" / "telemetry.db")
    world.round(None)
    world.collect(START + 3 * DAY)
    assert world.archived() == world.logged


def test_a_segment_that_the_gateways_disk_has_spoilt_is_sealed_again_from_the_log(world: World) -> None:
    world.run_days(0, 1)
    world.collect(START + DAY)
    world.log(START + DAY, START + 2 * DAY)

    class Away(FolderPlace):
        def put(self, path: str, content: bytes) -> None:
            raise ExchangeError("no route to host")

    world.round(START + 2 * DAY + 300, place=Away(world.folder / "exchange"))
    (name,) = [name for name in world.waiting() if "-00000002-" in name]
    spoilt = world.outbox / "segments" / name
    spoilt.write_bytes(spoilt.read_bytes()[:-20] + b"\0" * 20)
    assert go_on(world, 2) == []
    world.assert_complete()


@pytest.mark.parametrize("content", [b"", b"{", b'{"chain": "x"}', b"[]", b'{"through": 1e999}', b"\0" * 40])
def test_a_receipt_that_was_cut_off_forgets_nothing_and_is_written_again(
    world: World, tmp_path: Path, content: bytes
) -> None:
    world.run_days(0, 2)
    world.collect(START + 2 * DAY)
    (receipt,) = (tmp_path / "exchange" / SITE / "receipts").iterdir()
    whole = receipt.read_bytes()
    receipt.write_bytes(whole[: len(whole) // 2] if content == b"{" else content)
    status = world.round(START + 2 * DAY + 600)
    assert "receipt" in status.problem
    assert status.waiting == 2
    assert go_on(world, 2) == []
    world.assert_complete()
    assert world.waiting() == []


def test_a_receipt_for_more_than_was_sealed_is_not_believed(world: World, tmp_path: Path) -> None:
    world.run_days(0, 2)
    chain = world.waiting()[0][:12]
    receipt = {"chain": chain, "through": 999, "anchor": [0, ""], "beyond": {}}
    world.place.put(f"{SITE}/receipts/{chain}.json", json.dumps(receipt).encode())
    assert world.round(START + 2 * DAY + 600).receipted == 0
    assert go_on(world, 2) == []
    world.assert_complete()


def test_a_gap_in_a_chain_that_has_ended_is_asked_for_no_more(world: World, tmp_path: Path) -> None:
    world.run_days(0, 3)
    (tmp_path / "exchange" / SITE / "segments" / world.waiting()[1]).unlink()
    assert "segment 2 has not come yet" in world.collect(START + 3 * DAY).notes[0]
    shutil.rmtree(world.outbox)
    assert go_on(world, 3) == []
    world.assert_complete()


def test_a_segment_without_rows_or_records_is_collected_and_changes_nothing(world: World) -> None:
    world.run_days(0, 1)
    chain = world.waiting()[0][:12]
    end = float(START + 2 * DAY)
    digest = world.waiting()[0].split("-")[2][:64]
    blank = Seal(SITE, chain, 2, digest, end - DAY, end, end, "0.1.0", {}, 0, "", 0, "", 1)
    name, data = pack_segment(blank, concatenate([]), [])
    world.place.put(f"{SITE}/segments/{name}", data)
    done = world.collect(START + 2 * DAY)
    assert (done.segments, done.rows, done.notes) == (2, 144, [])
    world.assert_complete()


class Half(FolderPlace):
    """An exchange that lists only the first half of what is there."""

    def entries(self, folder: str) -> list[Entry]:
        found = super().entries(folder)
        return found[: len(found) // 2]


def test_half_of_a_listing_spoils_no_copy_of_the_bundles_and_gives_no_version_twice(tmp_path: Path) -> None:
    create_keys(tmp_path / "keys")
    bundle = write_tiny_bundle(tmp_path / "made", site=SITE).folder
    whole, half, copy = FolderPlace(tmp_path / "signed"), Half(tmp_path / "signed"), tmp_path / "copy"
    for _ in range(3):
        publish_in(bundle, whole, tmp_path / "keys")
        mirror(half, copy)
        assert_copy(whole, copy)
    before = json.loads((tmp_path / "signed" / "metadata" / "timestamp.json").read_text())["signed"]["version"]
    publish_in(bundle, half, tmp_path / "keys")
    refresh(half, tmp_path / "keys")
    after = json.loads((tmp_path / "signed" / "metadata" / "timestamp.json").read_text())["signed"]["version"]
    assert after == before + 2
    mirror(half, copy)
    assert_copy(whole, copy)


def assert_copy(place: FolderPlace, copy: Path) -> None:
    """The copy leads from its timestamp to the archive, by files that are those of the place."""
    for path in copy.glob("*/*"):
        assert path.read_bytes() == (place.root / path.relative_to(copy)).read_bytes()
    assert len(list((copy / "targets").iterdir())) == 1
    newest = json.loads((copy / "metadata" / "timestamp.json").read_text())["signed"]["version"]
    assert (copy / "metadata" / f"{newest}.snapshot.json").exists()


def test_a_copy_stays_what_it_was_where_a_signed_file_is_missing(tmp_path: Path) -> None:
    create_keys(tmp_path / "keys")
    place, copy = FolderPlace(tmp_path / "signed"), tmp_path / "copy"
    bundle = write_tiny_bundle(tmp_path / "made", site=SITE).folder
    publish_in(bundle, place, tmp_path / "keys")
    mirror(place, copy)
    before = {path.name: path.read_bytes() for path in copy.glob("*/*")}
    publish_in(bundle, place, tmp_path / "keys")
    newest = max((tmp_path / "signed" / "metadata").glob("*.targets.json"), key=lambda path: path.stat().st_mtime_ns)
    content = newest.read_bytes()
    newest.unlink()
    with pytest.raises(ExchangeError, match="not there"):
        mirror(place, copy)
    assert {path.name: path.read_bytes() for path in copy.glob("*/*")} == before
    for bad in (
        b'{"signed": {"targets": {"../../x": {"length": 1, "hashes": {"sha256": "' + b"a" * 64 + b'"}}}}}',
        b"[]",
    ):
        newest.write_bytes(bad)
        with pytest.raises(ExchangeError, match="no signed repository"):
            mirror(place, copy)
    newest.write_bytes(content)
    assert mirror(place, copy) > 0


def test_many_processes_that_ask_first_draw_one_name_for_the_archive(tmp_path: Path) -> None:
    from concurrent.futures import ThreadPoolExecutor

    from igrow.trainer.service.claim import _identity

    (Archive(tmp_path / "archive").root).mkdir()
    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(lambda _: _identity(tmp_path / "archive"), range(32)))) == 1
