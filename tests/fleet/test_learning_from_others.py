"""What sites share comes back to new ones as a prior; a site without a bundle of its own is calibrated first."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.core.bundle import read_bundle
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.trainer.cli import fleet as cli
from igrow.trainer.cli import main
from igrow.trainer.diagnosis.drift import Pair, read_drift
from igrow.trainer.fit.population import read_population
from igrow.trainer.fleet.registry import load_registry
from igrow.trainer.service import history
from igrow.trainer.service.archive import Archive
from tests.fleet.fleet_of_sites import make_fleet
from tests.virtual_log import SITE, disturbances, virtual_log

STEP, HOUR = 900.0, 3600.0
NAMES = ["one", "two", "three", "new"]


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four greenhouses of one builder, leakier than their descriptions; the new one has the longest log."""
    options = "{" + ", ".join(f"{name}: {{learning: true}}" for name in NAMES) + "}"
    fleet = make_fleet(tmp_path_factory.mktemp("learning"), NAMES, sites=options)
    archive = Archive(fleet / "state" / "archive")
    for number, name in enumerate(NAMES):
        days = 29 if name == "new" else 8
        built = nominal(SITE) | {"leakage_wind": 0.2, "transmissivity": 0.5 + 0.01 * number}
        archive.add_telemetry(
            name, virtual_log(days, seed=number, step=STEP, parameters=built, added=disturbances(days, STEP, number))
        )
    assert main(["keys", "create", str(fleet / "keys")]) == 0
    return fleet


@pytest.fixture(autouse=True)
def in_march(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "utc_now", lambda: datetime(2020, 3, 5, tzinfo=UTC))


def test_what_three_sites_share_is_the_fourths_prior_and_no_row_of_a_log_is_in_it(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", "learn", str(fleet), "--site", "one"]) == 2
    assert "1 sites have shared what they learned; 3 are needed" in capsys.readouterr().err
    assert main(["fleet", "learn", str(fleet), "--site", "one", "--site", "two", "--site", "three"]) == 0
    population = read_population(fleet / "state" / "population.json")
    assert population.sites == 3
    assert all(0.0 < one <= 1.0 for one in population.deviation.values())
    assert population.mean["leakage_wind"] > 0.0, "all of them leak more than they were described"
    shared = json.loads((fleet / "state" / "sites" / "one" / "learned.json").read_text())
    assert set(shared) == {"shift", "variance"}


def test_a_long_log_tells_how_a_site_changes_and_three_of_these_make_the_fleets_drift(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "utc_now", lambda: datetime(2020, 3, 23, tzinfo=UTC))
    options = "{" + ", ".join(f"{name}: {{learning: true}}" for name in NAMES[:3]) + "}"
    fleet = make_fleet(tmp_path, NAMES[:3], sites=options)
    log = virtual_log(50, seed=1, step=HOUR, added=disturbances(50, HOUR, 1))
    for name in NAMES[:3]:
        Archive(fleet / "state" / "archive").add_telemetry(name, log)
    assert main(["fleet", "learn", str(fleet), "--site", "one"]) == 2, "one is too few"
    assert "; how it changes" in capsys.readouterr().out
    folder = fleet / "state" / "sites" / "one"
    told = Pair.from_bytes((folder / "change.npz").read_bytes(), where="one")
    assert told.information.shape == (len(told.keys),) * 2
    for name in NAMES[1:3]:
        shutil.copytree(folder, fleet / "state" / "sites" / name)
    entries = load_registry(fleet).entries
    assert "how 3 sites change" in cli.write_shared(load_registry(fleet), entries)
    known, came = read_drift(fleet / "state" / "drift.json"), read_drift()
    assert known.rates != came.rates
    assert known.null_gains == came.null_gains
    assert cli.shared(entries[0], load_registry(fleet).drift) == str(fleet / "state" / "drift.json")
    assert cli.shared(replace(entries[0], learning=False), load_registry(fleet).drift) is None, "who gives nothing"


def test_a_site_without_a_bundle_is_calibrated_and_published_once(
    fleet: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", "calibrate", str(fleet)]) == 0
    output = capsys.readouterr().out
    assert "one: waiting; 8 days of log are there, 28 are needed" in output
    assert "new: calibrated; published " in output
    folder = fleet / "state" / "sites" / "new"
    (bundle,) = (folder / "bundles").iterdir()
    assert read_bundle(bundle).manifest.calibrated_on == "new"
    assert (fleet.parent / "exchange" / "new" / "bundles" / "metadata" / "timestamp.json").exists()
    (line,) = history.read(folder)
    assert (line["command"], line["verdict"], line["published"]) == ("calibrate", "calibrated", True)
    assert line["gain"] > 0.0
    assert main(["fleet", "calibrate", str(fleet), "--site", "new"]) == 0
    assert "was calibrated on it already" in capsys.readouterr().out
