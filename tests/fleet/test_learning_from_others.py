"""What sites share comes back to new ones as a prior; a site without a bundle of its own is calibrated first."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from igrow.core.bundle import read_bundle
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.trainer.cli import fleet as cli
from igrow.trainer.cli import main
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


@pytest.mark.slow
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


def test_what_sites_share_goes_to_those_alone_that_share(fleet: Path) -> None:
    entry = load_registry(fleet).entries[0]
    (file := fleet / "shared.json").write_text("{}")
    assert cli.shared(entry, file) == str(file)
    assert cli.shared(replace(entry, learning=False), file) is None, "who gives nothing"
    assert cli.shared(entry, fleet / "none.json") is None


@pytest.mark.slow
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
