"""Keys are made, taken offline, lost and replaced, and gateways follow; who can write to the exchange signs nothing."""

from __future__ import annotations

import json
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from igrow.edge.updates import UpdateError
from igrow.edge.updates.signed_source import SignedSource
from igrow.trainer.cli import main
from igrow.trainer.fleet.work import publish_site
from igrow.trainer.publishing import PublishingError, create_keys, publish_in, refresh
from igrow.trainer.publishing.keys import renew_root, replace_key, status, take_offline
from igrow.trainer.publishing.repository import targets_hold_until
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
    with pytest.raises(PublishingError, match=r"root keys in .*: 1, needed to sign: 2"):
        replace_key("targets", fleet.keys, [one])
    replace_key("targets", fleet.keys, [one, two])
    with pytest.raises(PublishingError, match="publish the bundle again"):
        refresh(fleet.repository, fleet.keys)
    assert fleet.publish(6.0) == fleet.fetched()

    evil = write_tiny_bundle(tmp_path / "evil", offset=1.0)
    with pytest.raises(PublishingError, match=r"is newer than .*stolen, whose keys were replaced"):
        publish_in(evil.folder, fleet.repository, tmp_path / "stolen")
    # A thief minds no such thing.
    fresh = fleet.repository / "metadata" / "2.root.json"
    fresh.rename(tmp_path / fresh.name)
    publish_in(evil.folder, fleet.repository, tmp_path / "stolen")
    (tmp_path / fresh.name).rename(fresh)
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


def test_a_bundle_that_stays_in_force_for_a_year_is_told_to_be_published_again(fleet: Fleet) -> None:
    """Refreshed month after month, it was said to be signed, and no gateway took it."""
    bundle, now = write_tiny_bundle(fleet.folder / "made"), datetime.now(UTC)
    long_ago = now - timedelta(days=340)
    publish_in(bundle.folder, fleet.repository, fleet.keys, now=long_ago)
    until = refresh(fleet.repository, fleet.keys)
    assert timedelta(days=24) < until - now < timedelta(days=26)
    assert fleet.fetched() == bundle.identity
    publish_in(bundle.folder, fleet.repository, fleet.keys, now=now - timedelta(days=366))
    with pytest.raises(PublishingError, match=r"has expired on .*, and only publishing the bundle again renews it"):
        refresh(fleet.repository, fleet.keys)
    publish_in(bundle.folder, fleet.repository, fleet.keys)
    assert fleet.fetched() == bundle.identity


def test_a_root_that_has_expired_signs_nothing_before_it_is_renewed(fleet: Fleet, monkeypatch) -> None:
    monkeypatch.setattr("igrow.trainer.publishing.keys.ROOT_LIFETIME", timedelta(days=-1))
    renew_root(fleet.keys, [fleet.keys])
    fleet.publish(5.0)
    with pytest.raises(UpdateError, match="signatures have expired"):
        fleet.source.fetch("demo", ())
    with pytest.raises(PublishingError, match=r"2.root.json: has expired.*`igrow-trainer keys renew "):
        refresh(fleet.repository, fleet.keys)
    monkeypatch.undo()
    assert main(["keys", "renew", str(fleet.keys)]) == 0
    refresh(fleet.repository, fleet.keys)
    assert fleet.fetched()


@pytest.mark.parametrize("action", ["replace", "renew"])
def test_the_fleet_hands_on_a_new_root_and_renews_what_names_a_bundle(
    fleet: Fleet, tmp_path: Path, monkeypatch, action: str
) -> None:
    """It waited until the other signatures were about to expire: for a month a stolen key went on to sign."""
    exchange: dict[str, str | None] = {
        "url": str(tmp_path / "exchange"),
        "base": ".",
        "known_hosts": None,
        "identity": None,
    }
    repository = tmp_path / "exchange" / "demo" / "bundles"
    source = SignedSource(repository, tmp_path / "gateway", tmp_path / "root.json")
    bundle, now = write_tiny_bundle(tmp_path / "made"), datetime.now(UTC)
    publish_in(bundle.folder, repository, fleet.keys)

    def published() -> str:
        given = ("demo", str(tmp_path / "state"), exchange, str(fleet.keys), now.timestamp())
        return str(publish_site(*given, again=False)["note"])

    assert published().startswith("signed until")
    said = ["keys", action, str(fleet.keys), *(["timestamp"] if action == "replace" else [])]
    assert main(said) == 0
    assert published() == "signed again"
    assert (repository / "metadata" / "2.root.json").exists()
    assert source.fetch("demo", ()) is not None
    monkeypatch.setattr("igrow.trainer.fleet.work.bundle_in_force", lambda *_: (bundle, ()))
    publish_in(bundle.folder, repository, fleet.keys, now=now - timedelta(days=340))
    assert published() == f"published {bundle.label} again"
    assert targets_hold_until(repository, fleet.keys) > now + timedelta(days=360)


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
    assert "root keys in" in capsys.readouterr().err
    assert main(["keys", "replace", keys, "timestamp", "--root", str(tmp_path / "stick")]) == 0
    assert "publish or refresh" in capsys.readouterr().out
    assert main(["keys", "replace", keys, "targets", "--root", str(tmp_path / "stick")]) == 0
    assert "gateways follow at the next publish of their site" in capsys.readouterr().out
    assert main(["keys", "replace", keys, "root", "--root", str(tmp_path / "stick")]) == 2
    assert "While 2 of them are safe they sign; else make new keys" in capsys.readouterr().err
    (tmp_path / "keys" / "targets.pem").unlink()
    assert main(["keys", "show", keys]) == 0
    assert "targets    1 of 1 must sign; not here" in capsys.readouterr().out


def test_keys_that_the_gateways_do_not_follow_sign_nothing_and_say_how_they_could(fleet: Fleet, tmp_path: Path) -> None:
    """A folder of keys that was made anew, or put back from an older copy, would seem to publish and reach nobody."""
    older = tmp_path / "older"
    shutil.copytree(fleet.keys, older)
    replace_key("timestamp", fleet.keys, [fleet.keys])
    fleet.publish(5.0)
    fleet.fetched()
    bundle = write_tiny_bundle(tmp_path / "bundle", offset=6.0)
    with pytest.raises(PublishingError, match=r"2\.root\.json: is newer than .*older, .* take the newest copy"):
        publish_in(bundle.folder, fleet.repository, older)
    new = tmp_path / "new"
    create_keys(new)
    for asked in (lambda: publish_in(bundle.folder, fleet.repository, new), lambda: refresh(fleet.repository, new)):
        with pytest.raises(
            PublishingError, match=r"1\.root\.json: is of other keys than .*new.* delete .*bundles and install"
        ):
            asked()
    assert fleet.fetched()
    shutil.rmtree(fleet.repository)
    shutil.copy(new / "1.root.json", tmp_path / "root.json")
    assert publish_in(bundle.folder, fleet.repository, new).identity == fleet.fetched()


def test_a_key_that_was_lost_is_told_with_the_command_that_makes_another(fleet: Fleet) -> None:
    (fleet.keys / "targets.pem").unlink()
    with pytest.raises(PublishingError, match=r"targets\.pem: .*`igrow-trainer keys replace` makes another"):
        fleet.publish()
