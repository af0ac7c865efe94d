"""A stick carries the log to the trainer, and receipts and bundles back, beside or instead of a network."""

from __future__ import annotations

import fcntl
import json
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.core.exchange import Below, FolderPlace
from igrow.edge.cli import main
from igrow.edge.image import Quality, Value
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.trainer.publishing import create_keys, publish_in
from igrow.trainer.service.archive import Archive
from igrow.trainer.service.collecting import collect
from tests.tiny_bundle import write_tiny_bundle

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def configuration(tmp_path: Path) -> Path:
    path = tmp_path / "daemon.yaml"
    path.write_text(
        f"site: {ROOT}/config/site.yaml\nregister_map: {ROOT}/config/register-maps/virtual-plc.yaml\nstate: state\n"
    )
    store = SqliteStore(tmp_path / "state" / "store", StoreLimits(survive_power_cut=False))
    yesterday = (datetime.now(UTC).timestamp() // 86_400 - 1) * 86_400
    for hour in range(24):
        store.append(yesterday + 3600 * hour, {"air_temperature": Value(20.0, Quality.GOOD, 0.0)})
    store.record_event(yesterday, "test", {})
    store.close()
    return path


def test_a_stick_goes_to_the_trainer_and_back(
    configuration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stick = tmp_path / "stick"
    stick.mkdir()
    sync = ["exchange", "sync", str(configuration), "--url", str(stick)]
    assert main(sync) == 0
    assert "1 segments wait for a receipt" in capsys.readouterr().out
    done = collect(FolderPlace(stick), "bleiswijk", Archive(tmp_path / "archive"), datetime.now(UTC))
    assert done.rows == 24
    create_keys(tmp_path / "keys")
    bundle = write_tiny_bundle(tmp_path / "made", site="bleiswijk")
    publish_in(bundle.folder, Below(FolderPlace(stick), "bleiswijk/bundles"), tmp_path / "keys")
    assert main(sync) == 0
    assert "0 segments wait for a receipt" in capsys.readouterr().out
    assert len(list((tmp_path / "state" / "exchange" / "bundles" / "targets").iterdir())) == 1
    assert main(["exchange", "status", str(configuration)]) == 0
    assert "all is well" in capsys.readouterr().out


def test_without_a_place_it_says_what_to_give(configuration: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["exchange", "status", str(configuration)]) == 0
    assert main(["exchange", "sync", str(configuration)]) == 2
    assert "name a place with --url" in capsys.readouterr().err


def test_a_stick_that_is_not_mounted_is_told_and_nothing_is_written_in_its_place(
    configuration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stick = tmp_path / "stick"
    assert main(["exchange", "sync", str(configuration), "--url", str(stick)]) == 2
    assert f"{stick}: there is no such folder; is the stick mounted?" in capsys.readouterr().err
    assert not stick.exists()


def test_a_round_by_hand_waits_for_the_daemons_own(
    configuration: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "stick").mkdir()
    sync = ["exchange", "sync", str(configuration), "--url", str(tmp_path / "stick")]
    folder = tmp_path / "state" / "exchange"
    folder.mkdir(parents=True)
    lock = (folder / "lock").open("w")
    fcntl.flock(lock, fcntl.LOCK_EX)
    threading.Timer(0.3, lock.close).start()
    assert main(sync) == 0
    assert "1 segments wait for a receipt" in capsys.readouterr().out

    # What is known of the exchange outlasts a round that could not be made, and one to a stick.
    status = json.loads((folder / "status.json").read_text())
    (folder / "status.json").write_text(json.dumps(status | {"file_system": "/srv/share"}))
    monkeypatch.setattr("igrow.edge.exchange.courier.LONGEST_WAIT", 0.2)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert main(sync) == 1
    told = capsys.readouterr().out
    assert "another round is under way, or hangs" in told
    assert "1 segments wait for a receipt" in told
    assert main(sync) == 0
    assert json.loads((folder / "status.json").read_text())["file_system"] == "/srv/share"
