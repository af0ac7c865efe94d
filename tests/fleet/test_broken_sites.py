"""Of fifty sites one breaks in each way: the others go on, and the page says of each what to do, the gravest first."""

from __future__ import annotations

import hashlib
import io
import json
import re
import tempfile
import zipfile
from collections.abc import Callable
from html import unescape
from pathlib import Path

import pytest

from igrow.core.exchange import FolderPlace, Seal, SegmentName
from igrow.trainer.cli import main
from igrow.trainer.service import history
from tests.fleet.fleet_of_sites import DAY, START, leave_day, make_fleet
from tests.made_once import made_once

NAMES = [f"greenhouse-{number:02}" for number in range(50)]
OF_SECONDS = 4_000_000


def state(fleet: Path, name: str) -> Path:
    folder = fleet / "state" / "sites" / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def write_site(fleet: Path, name: str, content: bytes) -> None:
    (fleet / "sites" / f"{name}.yaml").write_bytes(content)


def silent(fleet: Path, name: str) -> None:
    (path,) = (fleet.parent / "exchange" / name / "segments").iterdir()
    path.unlink()


def no_room(fleet: Path, name: str) -> None:
    """Nothing can be written where its log goes."""
    folder = fleet / "state" / "archive" / "telemetry"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"site={name}").write_text("")


def no_history(fleet: Path, name: str) -> None:
    state(fleet, name).rmdir()
    (fleet / "state" / "sites" / name).write_text("")


def too_large(fleet: Path, name: str) -> None:
    """A segment that takes more memory than the limit once it is unpacked."""
    table = b"time,air_temperature\n" + b"2026-02-16T00:00:00Z,\n" * OF_SECONDS
    digests = [hashlib.sha256(one).hexdigest() for one in (table, b"")]
    seal = Seal(
        name, "d" * 12, 1, "", START, START + DAY, START + DAY, "0.1.0", {"air_temperature": "degC"},
        OF_SECONDS, digests[0], 0, digests[1], 0,
    )  # fmt: skip
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("seal.json", json.dumps(seal.to_json()))
        archive.writestr("telemetry.csv", table)
        archive.writestr("events.jsonl", b"")
    segment = SegmentName("d" * 12, 1, hashlib.sha256(stream.getvalue()).hexdigest())
    FolderPlace(fleet.parent / "exchange").put(f"{name}/segments/{segment}", stream.getvalue())


def odd_report(fleet: Path, name: str) -> None:
    place = FolderPlace(fleet.parent / "exchange")
    place.put(f"{name}/reports/20260101T000000Z-a.json", b"[1, 2]")
    place.put(
        f"{name}/reports/20260102T000000Z-b.json", b'{"live_error": [1], "verdict": {}, "identity": [], "reason": 5}'
    )


def odd_diagnosis(fleet: Path, name: str) -> None:
    (state(fleet, name) / "diagnosis").mkdir()
    (state(fleet, name) / "diagnosis" / "diagnosis.json").write_text('{"findings": 7}')


def cut_history(fleet: Path, name: str) -> None:
    line = json.dumps(
        {"time": "2026-02-01T00:00:00Z", "command": "recalibrate", "verdict": "error", "note": "as it was"}
    )
    (state(fleet, name) / history.NAME).write_text(line + "\n" + line[:40])


BROKEN: dict[str, tuple[Callable[[Path, str], None], str]] = {
    "greenhouse-01": (silent, "nothing was ever collected: does its gateway run"),
    "greenhouse-02": (
        lambda fleet, name: write_site(fleet, name, b"name: greenhouse-02\nlatitude: 52.x\n"),
        "greenhouse-02.yaml:2:11",
    ),
    "greenhouse-03": (
        lambda fleet, name: write_site(fleet, name, b"name: greenhouse-03\nlatitud: 52\n"),
        "did you mean latitude",
    ),
    "greenhouse-04": (lambda fleet, name: write_site(fleet, name, b"[" * 5000), "nested too deeply"),
    "greenhouse-05": (lambda fleet, name: write_site(fleet, name, b"name: \xff\n"), "is not UTF-8 text"),
    "greenhouse-06": (no_room, "site=greenhouse-06/month=2026-02: Not a directory"),
    "greenhouse-07": (no_history, "its files cannot be shown"),
    "greenhouse-08": (
        too_large,
        "collect failed: it needs more memory than its limit of 1000 MB (tried again at the next run)",
    ),
    "greenhouse-09": (odd_report, ""),
    "greenhouse-10": (odd_diagnosis, "its files cannot be shown"),
    "greenhouse-11": (cut_history, "recalibrate failed: as it was (tried again at the next run)"),
}


@made_once
def collected_and_shown() -> dict[str, str]:
    """Collect and show a fleet of which some are broken; returns the cells of each row, in the order of the page."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        fleet = make_fleet(
            folder, NAMES, limits="{memory: 1000, retries: 0}", known_hosts="nowhere",
            sites="{greenhouse-12: {exchange: sftp://trainer@127.0.0.1:1/srv}, greenhouse-99: {paused: true}}",
        )  # fmt: skip
        for name in NAMES:
            leave_day(folder / "exchange", name, 1, step=3600)
        for name, (break_it, _) in BROKEN.items():
            break_it(fleet, name)
        assert main(["fleet", "collect", str(fleet)]) == 1
        assert main(["fleet", "status", str(fleet), "--page", str(folder / "www")]) == 0
        text = (folder / "www" / "index.html").read_text()
    return {name: unescape(cells) for name, cells in re.findall(r'<tr id="(.*?)">(.*?)</tr>', text, re.DOTALL)}


@pytest.fixture(scope="module")
def page() -> dict[str, str]:
    return collected_and_shown()


def test_every_site_has_its_row_and_those_that_are_well_have_their_data(page: dict[str, str]) -> None:
    assert sorted(page) == [*NAMES, "greenhouse-99"]
    for name in NAMES[13:]:
        assert "2026-02-16 23:00" in page[name]


@pytest.mark.parametrize("name", BROKEN)
def test_the_page_says_what_is_wrong_with_a_site(page: dict[str, str], name: str) -> None:
    assert BROKEN[name][1] in page[name]


def test_an_exchange_whose_key_is_not_pinned_and_options_without_a_site_are_named(page: dict[str, str]) -> None:
    assert "no such file; it must hold the key of 127.0.0.1" in page["greenhouse-12"]
    assert "no site greenhouse-99" in page["greenhouse-99"]


def test_who_needs_attention_most_comes_first(page: dict[str, str]) -> None:
    order = list(page)
    assert set(order[:7]) == {
        "greenhouse-02",
        "greenhouse-03",
        "greenhouse-04",
        "greenhouse-05",
        "greenhouse-07",
        "greenhouse-10",
        "greenhouse-99",
    }
    assert set(order[7:11]) == {"greenhouse-06", "greenhouse-08", "greenhouse-11", "greenhouse-12"}
    assert order.index("greenhouse-01") > order.index("greenhouse-13"), "silent for long comes before never heard of"
