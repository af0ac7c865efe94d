"""Attacks on the way from trainer to gateway, by the names that The Update Framework gives them."""

from __future__ import annotations

import io
import json
import shutil
import tarfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from igrow.core.bundle import BundleError
from igrow.edge.updates import Shelf, UpdateError
from igrow.edge.updates.signed_source import SignedSource
from igrow.trainer.publishing import PublishingError, create_keys, initialise, publish_in, refresh
from tests.tiny_bundle import write_tiny_bundle


class World:
    """A trainer that publishes and a gateway that fetches."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.keys = folder / "keys"
        self.repository = folder / "bundles"
        create_keys(self.keys)
        self.root = folder / "root.json"
        initialise(self.repository, self.keys)
        shutil.copy(self.keys / "1.root.json", self.root)
        self.source = SignedSource(self.repository, folder / "gateway", self.root)
        self.count = 0

    def publish(self, offset: float = 5.0, **options):
        self.count += 1
        bundle = write_tiny_bundle(self.folder / f"made-{self.count}", offset=offset)
        return publish_in(bundle.folder, self.repository, self.keys, **options)

    def metadata(self, name: str) -> Path:
        return self.repository / "metadata" / name

    def target(self) -> Path:
        return max((self.repository / "targets").glob("*.tar"), key=lambda path: path.stat().st_mtime_ns)


@pytest.fixture
def world(tmp_path: Path) -> World:
    return World(tmp_path)


def test_a_published_bundle_arrives_unchanged(world: World, tmp_path: Path) -> None:
    published = world.publish()
    fetched = world.source.fetch("demo", known=())
    assert fetched is not None
    assert fetched.identity == published.identity
    shelf = Shelf(tmp_path / "shelf", site="demo", igrow_version="0.1.0")
    assert shelf.put(fetched.archive).manifest == published.manifest


def test_nothing_is_fetched_for_another_site_or_for_a_known_bundle(world: World) -> None:
    published = world.publish()
    assert world.source.fetch("elsewhere", known=()) is None
    assert world.source.fetch("demo", known={published.identity}) is None


def test_an_exchange_without_bundles_is_no_fault(tmp_path: Path, world: World) -> None:
    assert SignedSource(tmp_path / "nowhere", tmp_path / "state", world.root).fetch("demo", ()) is None


def test_tampering_with_a_bundle_is_refused(world: World) -> None:
    world.publish()
    content = bytearray(world.target().read_bytes())
    content[2000] ^= 1
    world.target().write_bytes(content)
    with pytest.raises(UpdateError, match="tampered with or cut short"):
        world.source.fetch("demo", ())


def test_a_truncated_bundle_is_refused_and_accepted_once_it_is_whole(world: World) -> None:
    world.publish()
    content = world.target().read_bytes()
    world.target().write_bytes(content[:-512])
    with pytest.raises(UpdateError, match="tampered with or cut short"):
        world.source.fetch("demo", ())
    world.target().write_bytes(content)
    assert world.source.fetch("demo", ()) is not None


def test_a_bundle_longer_than_signed_is_refused_without_reading_it_all(world: World) -> None:
    world.publish()
    with world.target().open("ab") as stream:
        stream.write(b"x" * 1000)
    with pytest.raises(UpdateError, match="longer than signed"):
        world.source.fetch("demo", ())


def test_a_missing_bundle_is_said_to_be_missing(world: World) -> None:
    world.publish()
    world.target().unlink()
    with pytest.raises(UpdateError, match="is missing"):
        world.source.fetch("demo", ())


def test_a_pipe_in_place_of_a_file_does_not_block_the_gateway(world: World) -> None:
    import os

    world.publish()
    target = world.target()
    target.unlink()
    os.mkfifo(target)
    with pytest.raises(UpdateError, match="is missing"):
        world.source.fetch("demo", ())


@pytest.mark.parametrize("role", ["timestamp", "2.snapshot", "2.targets"])
def test_tampering_with_metadata_is_refused(world: World, role: str) -> None:
    world.publish()
    path = world.metadata(f"{role}.json")
    document = json.loads(path.read_text())
    document["signed"]["expires"] = "2099-01-01T00:00:00Z"
    path.write_text(json.dumps(document))
    with pytest.raises(UpdateError, match="not signed by the keys"):
        world.source.fetch("demo", ())


def test_rollback_to_older_metadata_is_refused(world: World, tmp_path: Path) -> None:
    world.publish(offset=5.0)
    shutil.copytree(world.repository, tmp_path / "old")
    world.publish(offset=6.0)
    assert world.source.fetch("demo", ()) is not None
    shutil.rmtree(world.repository)
    shutil.copytree(tmp_path / "old", world.repository)
    with pytest.raises(UpdateError, match="rollback"):
        world.source.fetch("demo", ())


def test_freeze_by_holding_back_newer_metadata_is_noticed_at_expiry(world: World) -> None:
    past = datetime.now(UTC) - timedelta(days=90)
    world.publish(now=past)
    with pytest.raises(UpdateError, match="expired"):
        world.source.fetch("demo", ())
    refresh(world.repository, world.keys)
    assert world.source.fetch("demo", ()) is not None


def test_a_gateway_whose_clock_is_not_set_accepts_nothing(world: World) -> None:
    world.publish()
    source = SignedSource(world.repository, world.folder / "gateway", world.root, wall=lambda: 1000.0)
    with pytest.raises(UpdateError, match="clock is not set"):
        source.fetch("demo", ())


def test_a_repository_signed_by_a_foreign_key_is_refused(world: World, tmp_path: Path) -> None:
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    attacker = World(foreign)
    attacker.publish()
    source = SignedSource(attacker.repository, world.folder / "gateway", world.root)
    with pytest.raises(UpdateError, match="not signed by the keys"):
        source.fetch("demo", ())


def test_mix_and_match_of_two_publications_is_refused(world: World) -> None:
    world.publish(offset=5.0)
    older = world.metadata("2.targets.json").read_bytes()
    world.publish(offset=6.0)
    world.metadata("3.targets.json").write_bytes(older)
    with pytest.raises(UpdateError, match=r"rollback|refused"):
        world.source.fetch("demo", ())


def test_a_snapshot_of_another_publication_is_refused(world: World) -> None:
    world.publish(offset=5.0)
    older = world.metadata("2.snapshot.json").read_bytes()
    world.publish(offset=6.0)
    world.metadata("3.snapshot.json").write_bytes(older)
    with pytest.raises(UpdateError, match=r"rollback|refused"):
        world.source.fetch("demo", ())


def test_a_full_disk_is_said_to_be_full_and_costs_only_the_update(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    world.publish()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("tuf.ngclient.updater.shutil.copyfileobj", full)
        with pytest.raises(UpdateError, match="No space left"):
            world.source.fetch("demo", ())
    assert world.source.fetch("demo", ()) is not None


def test_a_gateway_without_the_trainers_root_says_what_to_install(world: World) -> None:
    world.root.unlink()
    with pytest.raises(UpdateError, match=r"install the trainer's root\.json"):
        world.source.fetch("demo", ())


def archive_with(path: Path, change) -> Path:
    """Write an archive with one hostile member."""
    with tarfile.open(path, "w") as archive:
        member = tarfile.TarInfo("simulator.onnx")
        change(member)
        archive.addfile(member, io.BytesIO(b"\0" * member.size))
    return path


def link_elsewhere(member: tarfile.TarInfo) -> None:
    member.type, member.linkname = tarfile.SYMTYPE, "/etc"


@pytest.mark.parametrize(
    "change",
    [
        lambda member: setattr(member, "name", "../outside"),
        lambda member: setattr(member, "name", "/tmp/outside"),
        link_elsewhere,
        lambda member: setattr(member, "type", tarfile.FIFOTYPE),
        lambda member: setattr(member, "name", ".hidden"),
    ],
)
def test_an_archive_with_anything_but_plain_files_is_refused(tmp_path: Path, change) -> None:
    shelf = Shelf(tmp_path / "shelf", site="demo", igrow_version="0.1.0")
    with pytest.raises(UpdateError, match="not a plain file with a plain name"):
        shelf.put(archive_with(tmp_path / "hostile.tar", change))
    assert list((tmp_path / "shelf").iterdir()) == []


@pytest.mark.parametrize(
    ("options", "gateway", "message"),
    [
        ({}, {"igrow_version": "0.0.9"}, "made by igrow 0.1.0, newer than 0.0.9 here"),
        ({"golden_offset": 5.5}, {}, "self-test failed"),
        ({"quantity": "outdoor_humidity"}, {}, "outdoor_humidity in degC, expected %"),
    ],
)
def test_a_bundle_that_is_not_for_this_gateway_is_refused(tmp_path: Path, options, gateway, message: str) -> None:
    bundle = write_tiny_bundle(tmp_path / "made", **options)
    shelf = Shelf(tmp_path / "shelf", **{"site": "demo", "igrow_version": "0.1.0", **gateway})
    with pytest.raises((UpdateError, BundleError), match=message):
        shelf.put_folder(bundle.folder)
    assert list((tmp_path / "shelf").iterdir()) == []


def test_a_bundle_of_another_site_is_refused_from_the_exchange_but_not_from_the_operator(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path / "made", site="elsewhere")
    archive = tmp_path / "demo.tar"
    with tarfile.open(archive, "w") as tar:
        for path in bundle.folder.iterdir():
            tar.add(path, arcname=path.name)
    shelf = Shelf(tmp_path / "shelf", site="demo", igrow_version="0.1.0")
    with pytest.raises(UpdateError, match="made for site elsewhere, this gateway is demo"):
        shelf.put(archive)
    assert shelf.put_folder(bundle.folder).identity == bundle.identity


def test_the_trainer_does_not_publish_a_bundle_that_fails_its_self_test(world: World) -> None:
    bundle = write_tiny_bundle(world.folder / "bad", golden_offset=9.0)
    with pytest.raises(BundleError, match="self-test failed"):
        publish_in(bundle.folder, world.repository, world.keys)


def test_keys_and_repositories_are_never_overwritten(world: World) -> None:
    with pytest.raises(PublishingError, match="never overwritten"):
        create_keys(world.keys)
    with pytest.raises(PublishingError, match="exists already"):
        initialise(world.repository, world.keys)
    assert all(path.stat().st_mode & 0o077 == 0 for path in world.keys.glob("*.pem"))


def test_refreshing_needs_neither_the_root_nor_the_targets_key(world: World) -> None:
    world.publish()
    (world.keys / "root-1.pem").unlink()
    (world.keys / "targets.pem").unlink()
    refresh(world.repository, world.keys)
    assert world.source.fetch("demo", ()) is not None
    with pytest.raises(PublishingError, match=r"targets\.pem.*it is needed to sign"):
        world.publish(offset=7.0)
