"""Keys are made, taken offline, lost and replaced, and gateways follow; who can write to the exchange signs nothing."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from igrow.edge.updates import SignedSource, UpdateError
from igrow.trainer.cli import main
from igrow.trainer.publishing import PublishingError, create_keys, publish_in, refresh
from igrow.trainer.publishing.keys import renew_root, replace_key, status, take_offline
from tests.tiny_bundle import write_tiny_bundle


class Fleet:
    """A trainer with two of three root keys needed, and a gateway that trusts its first root."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.keys, self.repository = folder, folder / "keys", folder / "bundles"
        shutil.copy(create_keys(self.keys, root_keys=3, threshold=2), folder / "root.json")
        self.source = SignedSource(self.repository, folder / "gateway", folder / "root.json")

    def publish(self, offset: float = 5.0) -> str:
        bundle = write_tiny_bundle(self.folder / f"made-{offset}", offset=offset)
        return publish_in(bundle.folder, self.repository, self.keys).identity

    def fetched(self) -> str:
        found = self.source.fetch("demo", ())
        assert found is not None
        return found.identity


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    return Fleet(tmp_path)


def test_publishing_needs_no_root_key_once_the_repository_is_there(fleet: Fleet, tmp_path: Path) -> None:
    take_offline(fleet.keys, tmp_path / "stick")
    assert not list(fleet.keys.glob("root-*"))
    assert len(list((tmp_path / "stick").glob("root-*.pem"))) == 3
    assert all(path.stat().st_mode & 0o077 == 0 for path in (tmp_path / "stick").iterdir())
    assert fleet.publish() == fleet.fetched()


def test_a_stolen_key_is_replaced_with_two_sticks_and_the_gateway_follows(fleet: Fleet, tmp_path: Path) -> None:
    fleet.publish(5.0)
    fleet.fetched()
    shutil.copytree(fleet.keys, tmp_path / "stolen")
    one, two = tmp_path / "one", tmp_path / "two"
    for number, stick in ((1, one), (2, two)):
        stick.mkdir()
        (fleet.keys / f"root-{number}.pem").rename(stick / f"root-{number}.pem")
    (fleet.keys / "root-3.pem").unlink()
    with pytest.raises(PublishingError, match=r"1 root keys in .*, 2 are needed"):
        replace_key("targets", fleet.keys, [one])
    replace_key("targets", fleet.keys, [one, two])
    with pytest.raises(PublishingError, match="publish the bundle again"):
        refresh(fleet.repository, fleet.keys)
    assert fleet.publish(6.0) == fleet.fetched()

    evil = write_tiny_bundle(tmp_path / "evil", offset=1.0)
    publish_in(evil.folder, fleet.repository, tmp_path / "stolen")
    with pytest.raises(UpdateError, match="not signed by the keys"):
        fleet.source.fetch("demo", ())
    with pytest.raises(PublishingError, match="not signed by our present key"):
        refresh(fleet.repository, fleet.keys)
    assert fleet.publish(7.0) == fleet.fetched()


@pytest.mark.parametrize("role", ["targets", "snapshot", "timestamp"])
def test_each_online_key_can_be_replaced(fleet: Fleet, role: str) -> None:
    fleet.publish(5.0)
    fleet.fetched()
    replace_key(role, fleet.keys, [fleet.keys])
    assert fleet.publish(6.0) == fleet.fetched()


def test_a_root_can_be_renewed_years_later(fleet: Fleet) -> None:
    fleet.publish(5.0)
    renew_root(fleet.keys, [fleet.keys])
    assert status(fleet.keys)[2] == 2
    assert fleet.publish(6.0) == fleet.fetched()


def test_what_others_write_into_the_exchange_is_not_built_upon(fleet: Fleet) -> None:
    fleet.publish(5.0)
    path = fleet.repository / "metadata" / "2.targets.json"
    document = json.loads(path.read_text())
    document["signed"]["version"] = 9
    document["signed"]["targets"]["evil.tar"] = document["signed"]["targets"]["demo.tar"]
    (fleet.repository / "metadata" / "9.targets.json").write_text(json.dumps(document))
    assert fleet.publish(6.0) == fleet.fetched()
    newest = json.loads((fleet.repository / "metadata" / "10.targets.json").read_text())
    assert list(newest["signed"]["targets"]) == ["demo.tar"]


def test_metadata_and_archives_of_a_hundred_publications_do_not_pile_up(fleet: Fleet) -> None:
    for number in range(30):
        fleet.publish(5.0 + number / 10)
    assert len(list((fleet.repository / "metadata").iterdir())) <= 18
    assert len(list((fleet.repository / "targets").iterdir())) == 2
    fleet.fetched()


def test_a_gateway_with_another_root_takes_nothing(fleet: Fleet, tmp_path: Path) -> None:
    fleet.publish()
    create_keys(tmp_path / "foreign")
    source = SignedSource(fleet.repository, tmp_path / "other", tmp_path / "foreign" / "1.root.json")
    with pytest.raises(UpdateError, match="not signed by the keys"):
        source.fetch("demo", ())


def test_the_commands_make_show_and_move_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keys = str(tmp_path / "keys")
    assert main(["keys", "create", keys, "--root-keys", "2", "--threshold", "2"]) == 0
    assert main(["keys", "offline", keys, "--to", str(tmp_path / "stick")]) == 0
    capsys.readouterr()
    assert main(["keys", "show", keys]) == 0
    assert "root       2 of 2 must sign; offline" in capsys.readouterr().out
    assert main(["keys", "replace", keys, "timestamp"]) == 2
    assert "0 root keys" in capsys.readouterr().err
    assert main(["keys", "replace", keys, "timestamp", "--root", str(tmp_path / "stick")]) == 0
