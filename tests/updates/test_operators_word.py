"""The operator's word on the bundles: one that is pinned stays, one that is taken back goes, over restarts too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from igrow.edge.updates import UpdateRules
from igrow.edge.updates.state import load_state
from igrow.edge.updates.wishes import WISHES_FILE, Wishes, pin, read_wishes, take_back, unpin
from igrow.trainer.publishing import publish
from tests.tiny_bundle import write_tiny_bundle
from tests.updates.update_helpers import Gateway

RULES = UpdateRules(check_hours=1.0, shadow_hours=30.0, watch_hours=48.0, live_error_hours=6.0)


@pytest.fixture
def gateway(tmp_path: Path):
    made = Gateway(tmp_path, RULES)
    made.stop()
    made.start(first_bundle=write_tiny_bundle(tmp_path / "first", offset=4.0).folder)
    made.run(1)
    yield made
    made.stop()


def send(gateway: Gateway, name: str, offset: float):
    bundle = write_tiny_bundle(gateway.folder / name, offset=offset)
    return publish(bundle.folder, gateway.exchange_root, gateway.keys)


def in_force(gateway: Gateway) -> str:
    active = gateway.updates.active()
    return "" if active is None else active.name


def folder(gateway: Gateway) -> Path:
    return gateway.folder / "updates"


def state(gateway: Gateway):
    return load_state(folder(gateway) / "state.json")


def reports(gateway: Gateway) -> list[dict]:
    return [json.loads(path.read_text()) for path in sorted((gateway.folder / "transfer" / "reports").glob("*.json"))]


def test_no_update_replaces_a_pinned_bundle_until_it_is_no_longer_pinned(gateway: Gateway) -> None:
    first = gateway.updates.active()
    pin(folder(gateway), state(gateway))
    gateway.run(1)
    assert gateway.updates.describe()["pinned"] is True
    better = send(gateway, "better", 5.0)
    gateway.run(40)
    assert gateway.updates.active() == first
    assert "shadow_began" not in gateway.kinds()
    gateway.stop()
    gateway.start()
    gateway.run(40)
    assert gateway.updates.active() == first
    unpin(folder(gateway))
    gateway.run(36)
    assert in_force(gateway) == better.label


def test_a_candidate_in_the_shadow_gives_way_to_a_pin_and_may_come_again(gateway: Gateway) -> None:
    first = gateway.updates.active()
    better = send(gateway, "better", 5.0)
    gateway.run(5)
    assert gateway.updates.describe()["candidate"] == better.label
    pin(folder(gateway), state(gateway))
    gateway.run(40)
    assert gateway.updates.describe()["candidate"] is None
    assert gateway.updates.active() == first
    assert gateway.updates.describe()["rejected"] == {}
    unpin(folder(gateway))
    gateway.run(36)
    assert in_force(gateway) == better.label


def test_a_bundle_that_is_pinned_on_probation_is_not_taken_back_by_itself(gateway: Gateway) -> None:
    newer = send(gateway, "newer", 5.0)
    gateway.run(36)
    assert in_force(gateway) == newer.label
    pin(folder(gateway), state(gateway))
    gateway.offset = 4.0
    gateway.run(60)
    assert in_force(gateway) == newer.label


def test_the_operator_goes_back_and_the_bundle_is_never_tried_again_and_the_trainer_hears_of_it(
    gateway: Gateway,
) -> None:
    first = gateway.updates.active()
    newer = send(gateway, "newer", 5.0)
    gateway.run(36)
    assert in_force(gateway) == newer.label
    take_back(folder(gateway), state(gateway))
    gateway.run(1)
    assert gateway.updates.active() == first
    assert gateway.updates.describe()["rejected"] == {newer.identity: "taken back by the operator"}
    assert [report["verdict"] for report in reports(gateway)] == ["adopted", "went_back"]
    gateway.run(60)
    assert gateway.updates.active() == first
    gateway.stop()
    gateway.start()
    gateway.run(60)
    assert gateway.updates.active() == first
    assert [report["verdict"] for report in reports(gateway)] == ["adopted", "went_back"]


def test_a_word_that_is_given_while_no_daemon_runs_is_heard_at_the_next_start(gateway: Gateway) -> None:
    first = gateway.updates.active()
    send(gateway, "newer", 5.0)
    gateway.run(36)
    gateway.stop()
    take_back(folder(gateway), state(gateway))
    gateway.start()
    gateway.run(1)
    assert gateway.updates.active() == first


def test_a_wish_about_another_bundle_hits_nobody(gateway: Gateway) -> None:
    """The bundle in force has changed between the command and the daemon's look."""
    send(gateway, "newer", 5.0)
    gateway.run(36)
    active = gateway.updates.active()
    (folder(gateway) / WISHES_FILE).write_text('{"taken_back": "another", "pinned": "another"}')
    gateway.run(2)
    assert gateway.updates.active() == active
    assert gateway.updates.describe()["pinned"] is False


@pytest.mark.parametrize("content", ["", "[]", "{", '{"pinned": 7, "taken_back": [1]}', "\0" * 100])
def test_a_file_that_makes_no_sense_is_no_wish(gateway: Gateway, content: str) -> None:
    (folder(gateway) / WISHES_FILE).write_text(content)
    assert read_wishes(folder(gateway)) == Wishes()
    gateway.run(1)
    assert gateway.updates.health == ""
