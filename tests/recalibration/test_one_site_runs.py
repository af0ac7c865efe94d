"""What one run does for one site: waits, errs, publishes or keeps, and builds on nothing that a gateway took back."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.trainer.service import first_calibration, history, recalibration, seasons
from igrow.trainer.service.archive import Archive, SiteLog
from igrow.trainer.service.recalibration import recalibrate, relative_gain
from igrow.trainer.service.site_memory import bundle_in_force, forget_old
from tests.tiny_bundle import write_tiny_bundle

SITE = Site(name="greenhouse", latitude=52.0, longitude=4.5)
NOON = datetime(2020, 3, 1, 12, tzinfo=UTC)


def refuse(folder: Path) -> None:
    pytest.fail(f"{folder} was published")


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    made = Archive(tmp_path / "archive")
    time = np.datetime64("2020-02-20T00:00:00") + np.arange(0, 9 * 86_400, 600).astype("timedelta64[s]")
    time = time[(time < np.datetime64("2020-02-24")) | (time >= np.datetime64("2020-02-26"))]
    made.add_telemetry("greenhouse", Telemetry(time, {"air_temperature": np.full(len(time), 20.0)}))
    return made


@pytest.fixture
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Put a diagnosis of no time in the place of the real one; collects the bundles that it is asked to build on."""
    asked: list[str] = []

    def diagnose(site, log, bundle, target):
        asked.append(bundle.identity)
        errors = {"air_temperature": {"24_h": {"deployed": 1.0, "corrected": 0.8}}}
        causes = (SimpleNamespace(effect="wind_infiltration"),)
        return SimpleNamespace(verdict="named", findings=causes, errors=errors, notes=(), corrected=10.0 + len(asked))

    def write(offset: float, now: datetime, folder: Path) -> tuple[str, ...]:
        write_tiny_bundle(folder, site="greenhouse", offset=offset)
        return ()

    monkeypatch.setattr(recalibration, "_diagnose", diagnose)
    monkeypatch.setattr(seasons, "export_planned", write)
    return asked


def leave_report(archive: Archive, number: int, identity: str, verdict: str) -> None:
    content = json.dumps({"site": "greenhouse", "identity": identity, "verdict": verdict})
    archive.add_file(
        "reports", "greenhouse", f"2020030{number}T000000Z-{identity[:8]}-{verdict}.json", content.encode()
    )


def test_a_site_without_telemetry_is_an_error_in_its_history_and_publishes_nothing(tmp_path: Path) -> None:
    turn = recalibrate(SITE, Archive(tmp_path / "none"), tmp_path / "state", refuse, now=NOON)
    assert turn.verdict == "error"
    (line,) = history.read(tmp_path / "state")
    assert line["time"] == "2020-03-01T12:00:00Z"
    assert "no telemetry of site greenhouse" in line["note"]


def test_an_error_is_tried_again_at_the_next_run_and_a_success_waits_for_the_sites_pace(
    tmp_path: Path, archive: Archive, diagnosed: list[str]
) -> None:
    state = tmp_path / "state"
    published: list[Path] = []
    assert recalibrate(SITE, Archive(tmp_path / "none"), state, refuse, now=NOON).verdict == "error"
    hour = timedelta(hours=1)
    assert recalibrate(SITE, archive, state, published.append, now=NOON + hour).published
    early = recalibrate(SITE, archive, state, refuse, now=NOON + timedelta(days=3))
    assert (early.verdict, early.note) == ("waiting", "next at 2020-03-08 13:00 UTC")
    assert recalibrate(SITE, archive, state, published.append, now=NOON + timedelta(days=7, hours=1)).published
    assert [line["verdict"] for line in history.read(state)] == ["error", "named", "named"]
    assert len(published) == 2


def test_days_without_a_row_are_named(tmp_path: Path, archive: Archive, diagnosed: list[str]) -> None:
    turn = recalibrate(SITE, archive, tmp_path / "state", lambda _: None, now=NOON)
    assert turn.notes == ("2 days have no row: 2020-02-24, 2020-02-25",)
    assert history.read(tmp_path / "state")[0]["notes"] == list(turn.notes)


@pytest.mark.parametrize("verdict", ["went_back", "rejected", "withdrawn", "refused"])
def test_a_bundle_that_the_gateway_took_back_is_not_built_upon(
    tmp_path: Path, archive: Archive, diagnosed: list[str], verdict: str
) -> None:
    state = tmp_path / "state"
    first = read_bundle(default_bundle_folder()).identity
    recalibrate(SITE, archive, state, lambda _: None, now=NOON)
    (made,) = (state / "bundles").iterdir()
    second = read_bundle(made).identity
    leave_report(archive, 2, second, "adopted")
    recalibrate(SITE, archive, state, lambda _: None, now=NOON + timedelta(days=1), force=True)
    assert diagnosed == [first, second]
    third = read_bundle(sorted((state / "bundles").iterdir())[-1]).identity
    leave_report(archive, 3, third, "adopted")
    leave_report(archive, 4, third, verdict)
    recalibrate(SITE, archive, state, lambda _: None, now=NOON + timedelta(days=2), force=True)
    assert diagnosed == [first, second, second]


def test_a_bundle_that_is_pinned_again_after_it_was_taken_back_is_in_force(tmp_path: Path) -> None:
    bundle = write_tiny_bundle(tmp_path / "bundles" / "20200301T000000Z", site="greenhouse")
    reports = [{"identity": bundle.identity, "verdict": verdict} for verdict in ("adopted", "went_back", "adopted")]
    assert bundle_in_force(tmp_path, reports[:2])[0].identity != bundle.identity
    assert bundle_in_force(tmp_path, reports)[0].identity == bundle.identity


def test_the_bundle_in_force_outlives_any_number_of_refused_ones(tmp_path: Path) -> None:
    good = write_tiny_bundle(tmp_path / "bundles" / "20200301T000000Z", site="greenhouse")
    reports = []
    for day in range(2, 12):
        bad = write_tiny_bundle(tmp_path / "bundles" / f"202003{day:02}T000000Z", site="greenhouse", offset=100.0 + day)
        reports.append({"identity": bad.identity, "verdict": "went_back"})
        forget_old(tmp_path / "bundles", bundle_in_force(tmp_path, reports)[0].folder)
    assert bundle_in_force(tmp_path, reports)[0].identity == good.identity
    assert len(list((tmp_path / "bundles").iterdir())) == 6


def test_a_damaged_published_bundle_is_named_and_its_predecessor_is_built_upon(tmp_path: Path) -> None:
    good = write_tiny_bundle(tmp_path / "bundles" / "20200301T000000Z", site="greenhouse")
    bad = write_tiny_bundle(tmp_path / "bundles" / "20200302T000000Z", site="greenhouse", offset=6.0)
    (bad.folder / "simulator.onnx").write_bytes(b"flash rot")
    bundle, notes = bundle_in_force(tmp_path, [])
    assert bundle.identity == good.identity
    assert len(notes) == 1
    assert "its predecessor is built upon" in notes[0]


@pytest.mark.parametrize("content", [b"[]", b"3", b'{"a":' + b"[" * 100_000, b"\xff\xfe", b"", b'{"verdict": null}'])
def test_a_report_that_is_none_is_named_and_changes_nothing(
    tmp_path: Path, archive: Archive, diagnosed: list[str], content: bytes
) -> None:
    archive.add_file("reports", "greenhouse", "20200301T000000Z-x-adopted.json", content)
    turn = recalibrate(SITE, archive, tmp_path / "state", lambda _: None, now=NOON)
    assert turn.verdict == "named"
    assert (content == b'{"verdict": null}') or any("report 20200301T000000Z-x-adopted.json" in n for n in turn.notes)


def test_a_history_that_was_cut_short_is_read_and_gone_on_with(tmp_path: Path, archive, diagnosed: list[str]) -> None:
    state = tmp_path / "state"
    recalibrate(SITE, archive, state, lambda _: None, now=NOON)
    path = state / "history.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole + whole[: len(whole) // 2])
    assert recalibrate(SITE, archive, state, refuse, now=NOON + timedelta(days=1)).verdict == "waiting"
    recalibrate(SITE, archive, state, lambda _: None, now=NOON + timedelta(days=8))
    assert len(history.read(state)) == 2


def test_a_damaged_day_of_the_archive_is_named_and_the_others_are_used(
    tmp_path: Path, archive: Archive, diagnosed: list[str]
) -> None:
    path = archive.root / "telemetry" / "site=greenhouse" / "month=2020-02" / "2020-02-21.parquet"
    path.write_bytes(path.read_bytes()[:500])
    turn = recalibrate(SITE, archive, tmp_path / "state", lambda _: None, now=NOON)
    assert turn.verdict == "named"
    assert any("2020-02-21.parquet: cannot be read" in note for note in turn.notes)


def test_a_fault_of_ours_is_one_sites_error_with_its_traceback_kept(tmp_path: Path, archive, monkeypatch) -> None:
    def broken(*_):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(recalibration, "_diagnose", broken)
    turn = recalibrate(SITE, archive, tmp_path / "state", refuse, now=NOON)
    assert turn.verdict == "error"
    assert "ZeroDivisionError: a bug" in turn.note
    assert "Traceback" in (tmp_path / "state" / "fault.txt").read_text()


def test_a_fault_of_ours_in_a_first_calibration_is_one_sites_error_too(tmp_path: Path, monkeypatch) -> None:
    def broken(*_):
        raise ZeroDivisionError("a bug")

    weeks = Archive(tmp_path / "archive")
    time = np.datetime64("2020-01-20T00:00:00") + np.arange(0, 40 * 86_400, 3600).astype("timedelta64[s]")
    weeks.add_telemetry("greenhouse", Telemetry(time, {"air_temperature": np.full(len(time), 20.0)}))
    monkeypatch.setattr(first_calibration, "_calibrate", broken)
    turn = first_calibration.calibrate_first(SITE, weeks, tmp_path / "state", refuse, now=NOON, days=60)
    assert (turn.command, turn.verdict) == ("calibrate", "error")
    assert "ZeroDivisionError: a bug" in turn.note
    assert [line["command"] for line in history.read(tmp_path / "state")] == ["calibrate"]


def test_the_gain_is_negative_where_the_new_model_is_worse_on_unseen_days() -> None:
    def errors(corrected: float):
        return {"air_temperature": {"24_h": {"deployed": 1.0, "recalibrated": 1.0, "corrected": corrected}}}

    assert relative_gain(errors(0.75)) == pytest.approx(0.25)
    assert relative_gain(errors(1.5)) == pytest.approx(-0.5)


def test_the_command_goes_on_after_a_bad_site_and_its_exit_code_tells(tmp_path: Path, capsys) -> None:
    from igrow.trainer.cli import main

    (tmp_path / "bad.yaml").write_text("name: [")
    (tmp_path / "empty.yaml").write_text("name: empty\nlatitude: 52\nlongitude: 4\n")
    (tmp_path / "exchange").mkdir()
    arguments = ["recalibrate", "--exchange", str(tmp_path / "exchange"), "--keys", "keys", "--state", str(tmp_path)]
    for _ in range(2):
        assert main([*arguments, "--site", str(tmp_path / "bad.yaml"), "--site", str(tmp_path / "empty.yaml")]) == 1
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].startswith("bad: error; ")
        assert lines[1].startswith("empty: error; no telemetry of site empty")


def test_a_new_crop_is_calibrated_on_its_own_weeks(tmp_path: Path, monkeypatch) -> None:
    """Ten days before the planting, thirty since; the bundle of before was calibrated on the site itself."""
    default, seen = read_bundle(default_bundle_folder()), list[SiteLog]()
    own = replace(default, manifest=replace(default.manifest, calibrated_on="greenhouse"))
    end = history.Turn("calibrate", "greenhouse", NOON, "calibrated", False, "calibrated on the new crop")

    def calibrate(_site: Site, log: SiteLog, *_: object) -> history.Turn:
        seen.append(log)
        return end

    monkeypatch.setattr(first_calibration, "_calibrate", calibrate)
    monkeypatch.setattr(first_calibration, "_has_new_crop", lambda site, *_: site.crop.planting_date.year == 2020)
    monkeypatch.setattr(first_calibration, "bundle_in_force", lambda *_: (own, ()))
    weeks = Archive(tmp_path / "archive")
    time = np.datetime64("2020-01-20T00:00:00") + np.arange(0, 40 * 86_400, 3600).astype("timedelta64[s]")
    weeks.add_telemetry("greenhouse", Telemetry(time, {"air_temperature": np.full(len(time), 20.0)}))

    def turn(day: date) -> str:
        site = replace(SITE, crop=replace(SITE.crop, planting_date=day))
        return first_calibration.calibrate_first(site, weeks, tmp_path / "state", refuse, now=NOON, days=60).note

    assert "was calibrated on it already" in turn(date(2019, 12, 1))
    assert turn(date(2020, 2, 10)).endswith("days of log are there, 28 are needed")
    assert turn(date(2020, 1, 30)) == end.note
    assert seen[0].telemetry.time[0] == np.datetime64("2020-01-30T00:00:00")


def test_what_was_calibrated_with_other_balances_is_calibrated_anew(tmp_path: Path, monkeypatch) -> None:
    default = read_bundle(default_bundle_folder())
    fitted = default.manifest.parameters
    parameters = {**fitted, "air_blocked": fitted["leakage_wind"]}
    earlier = replace(default, manifest=replace(default.manifest, calibrated_on="greenhouse", parameters=parameters))
    monkeypatch.setattr(first_calibration, "bundle_in_force", lambda *_: (earlier, ()))
    weeks = Archive(tmp_path / "archive")
    turn = first_calibration.calibrate_first(SITE, weeks, tmp_path / "state", refuse, now=NOON, days=60)
    assert turn.note.endswith("days of log are there, 28 are needed")
