"""Fifty sites come to one page in two commands; whatever is wrong with one is on its line and stops no other."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from igrow.trainer.cli import main
from igrow.trainer.service import history
from tests.fleet.fleet_of_sites import leave_day, make_fleet


def test_fifty_sites_come_to_one_page_in_two_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"greenhouse-{number:02}" for number in range(50)]
    fleet = make_fleet(tmp_path, names)
    for name in names[:-1]:
        previous = ""
        for number in (1, 2):
            previous = leave_day(tmp_path / "exchange", name, number, previous, step=3600)
    (tmp_path / "exchange" / "greenhouse-07" / "segments").joinpath(f"{'d' * 12}-00000001-{'0' * 64}.zip").write_bytes(
        b"cut off"
    )

    assert main(["fleet", "collect", str(fleet)]) == 0
    assert main(["fleet", "status", str(fleet), "--page", str(tmp_path / "www")]) == 0

    page = (tmp_path / "www" / "index.html").read_text()
    assert sorted(re.findall(r'<tr id="(.*?)">', page)) == names
    assert "<h1>50 greenhouses</h1>" in page
    assert "http" not in page.replace("http-equiv", "")
    output = capsys.readouterr().out
    assert "greenhouse-49  never" in output
    assert "the gateway sends it again" in page


def test_bad_sites_are_named_and_the_others_are_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fleet = make_fleet(tmp_path, ["good", "cut", "elsewhere"], sites="{elsewhere: {exchange: ../file}}")
    (fleet / "sites" / "broken.yaml").write_text("name: broken\nlatitude: north\n")
    (tmp_path / "file").write_text("a file where a folder is needed")
    leave_day(tmp_path / "exchange", "good", 1)
    leave_day(tmp_path / "exchange", "cut", 1)
    for _ in range(2):
        assert main(["fleet", "collect", str(fleet)]) == 1
    output = capsys.readouterr().out
    assert "broken: error; " in output
    assert "latitude" in output
    assert re.search(r"good: 1 segments, 144 rows", output)
    assert re.search(r"elsewhere: error; .*file", output)
    lines = history.read(fleet / "state" / "sites" / "elsewhere")
    assert [line["verdict"] for line in lines] == ["error", "error"], "it is tried again at each run"
    main(["fleet", "status", str(fleet)])
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[:2]] == ["broken", "elsewhere"], "who needs attention comes first"


def test_a_paused_site_is_left_alone_and_an_unknown_one_is_refused(tmp_path: Path, capsys) -> None:
    fleet = make_fleet(tmp_path, ["one", "two"], sites="{two: {paused: true}}")
    assert main(["fleet", "collect", str(fleet)]) == 0
    assert "[1/1] one" in capsys.readouterr().out
    assert main(["fleet", "collect", str(fleet), "--site", "three"]) == 2
    assert re.search(r"three: no such site in \S+; known: (one, two|two, one)\n", capsys.readouterr().err)
    assert main(["fleet", "collect", str(fleet), "--site", "one", "--site", "two"]) == 2
    assert "error: two: it is paused" in capsys.readouterr().err
    assert main(["fleet", "learn", str(fleet), "--site", "one"]) == 2
    assert "error: one: it does not say learning: true" in capsys.readouterr().err


def test_a_site_that_took_its_bundle_back_and_one_with_a_finding_come_before_those_that_are_well(
    tmp_path: Path, capsys
) -> None:
    fleet = make_fleet(tmp_path, ["well", "found", "returned"])
    archive = fleet / "state" / "archive" / "reports" / "returned"
    archive.mkdir(parents=True)
    report = {
        "identity": "a",
        "verdict": "went_back",
        "reason": "worse",
        "live_error": {"before": {"air_temperature 24_h": 0.5}},
    }
    (archive / "20260301T000000Z-a-went_back.json").write_text(json.dumps(report))
    history.append(
        fleet / "state" / "sites" / "found",
        {"time": "2026-03-01T00:00:00Z", "command": "recalibrate", "verdict": "named", "causes": ["screen_gap"]},
    )
    for name in ("well", "found", "returned"):
        leave_day(tmp_path / "exchange", name, 1)
    main(["fleet", "collect", str(fleet)])
    ledgers = fleet / "state" / "archive" / "ledger"
    for path in ledgers.glob("*.json"):
        document = json.loads(path.read_text())
        document["newest"] = 4e9  # as if it had come today
        path.write_text(json.dumps(document))
    capsys.readouterr()
    main(["fleet", "status", str(fleet)])
    shown = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in shown] == ["found", "returned", "well"]
    assert "screen gap" in " ".join(shown[0])
    assert "the gateway went back: worse" in " ".join(shown[1])


def test_a_fleet_without_sites_or_file_says_what_to_do(tmp_path: Path, capsys) -> None:
    assert main(["fleet", "status", str(tmp_path)]) == 2
    assert "fleet.yaml" in capsys.readouterr().err
    (tmp_path / "fleet.yaml").write_text("exchange: x\n")
    assert main(["fleet", "status", str(tmp_path)]) == 2
    assert "no site file" in capsys.readouterr().err
