"""A wrong clock, a changed unit, a new or renamed point: days that were right stay right, and all of them arrive."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from igrow.core.exchange import Seal, SegmentError, SegmentName, open_segment, pack_segment
from igrow.core.telemetry import Telemetry
from igrow.edge.image import Quality, Value
from igrow.trainer.service.collecting import collect
from tests.exchange.gateway_and_trainer import DAY, SITE, START, World

TEN_YEARS = 3653 * DAY
NOON = START + DAY // 2


def test_a_clock_ten_years_ahead_for_seconds_stops_no_day_from_arriving(world: World) -> None:
    world.log(START, NOON)
    world.store.append(NOON + TEN_YEARS, {"air_temperature": Value(1.0, Quality.GOOD, 0.0)})
    world.round(NOON + TEN_YEARS)
    world.log(NOON, START + DAY)
    world.round(START + DAY + 300)
    world.run_days(1, 3)
    world.collect(START + 3 * DAY)
    world.assert_complete()


def test_a_clock_ten_years_ahead_for_two_days_is_named_and_its_rows_are_set_aside(world: World) -> None:
    world.run_days(0, 1)
    for hour in range(48):
        time = START + TEN_YEARS + 3600 * hour
        world.store.append(time, {"air_temperature": Value(1.0, Quality.GOOD, 0.0)})
    world.round(START + TEN_YEARS + 2 * DAY + 300)
    for day in range(3, 6):
        world.log(START + day * DAY, START + (day + 1) * DAY)
        for hour in range(0, 24, 2):
            world.round(START + day * DAY + 3600 * hour)
    world.round(START + 6 * DAY + 300)
    done = world.collect(START + 6 * DAY)
    assert any("dated 2036-02-17" in note and "a clock was wrong" in note for note in done.notes), done.notes
    world.assert_complete()


def test_a_clock_that_was_behind_for_some_hours_loses_nothing_that_was_logged_then(world: World) -> None:
    world.run_days(0, 2)
    behind = START - 400 * DAY
    world.log(behind, behind + 3 * 3600)
    for hour in range(3):
        world.round(behind + 3600 * hour + 1800)
    world.run_days(2, 4)
    world.collect(START + 4 * DAY)
    world.assert_complete()


def test_a_clock_that_was_ahead_and_is_set_right_for_good_goes_on_from_there(world: World) -> None:
    ahead = START + 90 * DAY
    world.log(ahead, ahead + DAY)
    world.round(ahead + DAY + 300)
    for day in range(3):
        world.log(START + day * DAY, START + (day + 1) * DAY)
        for hour in range(24):
            world.round(START + day * DAY + 3600 * hour)
    world.round(START + 3 * DAY + 300)
    world.collect(ahead + 2 * DAY)
    world.assert_complete()


def test_rows_of_the_year_9999_are_named_and_stay_out(world: World, tmp_path: Path) -> None:
    time = np.array(["2026-02-16T00:00:00", "9999-01-01T00:00:00"], dtype="datetime64[s]")
    rows = Telemetry(time, {"air_temperature": np.array([20.0, 21.0])})
    end = float(np.datetime64("9999-01-02", "s").astype(int))
    seal = Seal(SITE, "a" * 12, 1, "", float(START), end, end, "0.1.0", {"air_temperature": "degC"}, 0, "", 0, "", 0)
    name, data = pack_segment(seal, rows, [{"sequence": 1, "category": "event", "time": 9e99, "kind": "odd"}])
    world.place.put(f"{SITE}/segments/{name}", data)
    done = world.collect(START + DAY)
    assert "1 rows dated 9999-01-01T00:00:00" in done.notes[0]
    assert "no time since 1970" in done.notes[1]
    assert world.archived() == {START: 20.0}
    assert [path.name for path in (tmp_path / "archive" / "refused" / SITE).iterdir()] == [str(name)]


def segment(number: int, rows: Telemetry, units: dict[str, str]):
    start = float(rows.time[0].astype(int))
    seal = Seal(SITE, "b" * 12, number, "", start, start + DAY, start + DAY, "0.1.0", units, 0, "", 0, "", 0)
    return pack_segment(seal, rows, [])


def test_a_changed_unit_is_brought_to_the_registrys(world: World) -> None:
    time = np.array([START], dtype="datetime64[s]")
    name, data = segment(1, Telemetry(time, {"air_temperature": np.array([68.0])}), {"air_temperature": "degF"})
    opened = open_segment(name, data, SITE)
    assert opened.telemetry["air_temperature"][0] == pytest.approx(20.0)


def test_a_quantity_or_unit_that_is_not_known_is_kept_apart_and_named(world: World, tmp_path: Path) -> None:
    time = np.array([START], dtype="datetime64[s]")
    rows = Telemetry(
        time, {"air_temperature": np.array([20.0]), "slab_weight": np.array([7.0]), "air_co2": np.array([3.0])}
    )
    name, data = segment(1, rows, {"air_temperature": "degC", "slab_weight": "kg", "air_co2": "g m-3"})
    world.place.put(f"{SITE}/segments/{name}", data)
    done = collect(world.place, SITE, world.archive, datetime(2026, 3, 1, tzinfo=UTC))
    assert done.notes == [
        "segment 1: slab_weight [kg], air_co2 [g m-3]: no quantity and unit that this igrow knows; kept apart"
    ]
    assert world.archived() == {START: 20.0}
    (path,) = (tmp_path / "archive" / "foreign").rglob("*.parquet")
    assert pq.ParquetFile(path).read().column_names == ["time", "air_co2 [g m-3]", "slab_weight [kg]"]


def test_a_new_sensor_adds_a_column_and_leaves_the_days_before_as_they_are(world: World, tmp_path: Path) -> None:
    world.run_days(0, 1)
    world.store.append(START + DAY + 60, {"air_co2": Value(700.0, Quality.GOOD, 0.0)})
    world.round(START + 2 * DAY + 300)
    world.collect(START + 2 * DAY)
    log = world.archive.read(SITE, datetime.fromtimestamp(START, UTC).date(), datetime(2026, 3, 1, tzinfo=UTC).date())
    assert log.telemetry["air_co2"][-1] == 700.0
    assert np.isnan(log.telemetry["air_co2"][:-1]).all()
    assert len(log.telemetry) == 145


def test_what_was_collected_first_is_not_rewritten_by_what_comes_late(world: World) -> None:
    time = np.array([START], dtype="datetime64[s]")
    for number, value in ((1, 20.0), (2, 25.0)):
        name, data = segment(
            number, Telemetry(time, {"air_temperature": np.array([value])}), {"air_temperature": "degC"}
        )
        world.place.put(f"{SITE}/segments/{name}", data)
        done = world.collect(START + DAY)
    assert world.archived() == {START: 20.0}
    assert any("1 values differ" in note for note in done.notes)


def forged(table: bytes, lines: bytes, **changed: object) -> tuple[SegmentName, bytes]:
    """Return a segment of any content under a seal that fits it, but for what is changed."""
    name, data = segment(
        1,
        Telemetry(np.array([START], dtype="datetime64[s]"), {"air_temperature": np.array([1.0])}),
        {"air_temperature": "degC"},
    )
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        seal = json.loads(archive.read("seal.json"))
    seal["telemetry"]["sha256"] = hashlib.sha256(table).hexdigest()
    seal["events"] |= {"sha256": hashlib.sha256(lines).hexdigest(), "records": len(lines.splitlines())}
    seal |= changed
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("seal.json", json.dumps(seal))
        archive.writestr("telemetry.csv", table)
        archive.writestr("events.jsonl", lines)
    return replace(name, digest=hashlib.sha256(stream.getvalue()).hexdigest()), stream.getvalue()


GOOD = b"time,air_temperature\n2026-02-16T00:00:00Z,20\n"


@pytest.mark.parametrize(
    ("table", "lines", "reason"),
    [
        (GOOD.replace(b"20\n", b"1" * 200_000 + b"\n"), b"", "field larger than field limit"),
        (b"air_temperature\n20\n", b"", "first column must be time"),
        (GOOD.replace(b"20\n", b"warm\n"), b"", "a number or an empty cell is needed"),
        (GOOD.replace(b"20\n", b"\xff\n"), b"", "is not UTF-8"),
        (GOOD.replace(b"-16T", b"-15T"), b"", "rows outside"),
        (GOOD, b'{"a":' + b"[" * 200_000 + b"]" * 200_000 + b"}\n", "nested too deeply"),
        (GOOD, b"[1, 2]\n", "a list where an object"),
        (GOOD, b"{broken\n", "not JSON"),
        (b"", b"", "first column must be time"),
        (b"time,air_temperature\n", b"", "has 0 rows and 0 records, its seal says 1 and 0"),
        (GOOD.replace(b",20\n", b",1e39\n"), b"", "which no sensor shows"),
    ],
)
def test_content_that_cannot_be_used_is_refused_in_one_sentence(table: bytes, lines: bytes, reason: str) -> None:
    with pytest.raises(SegmentError, match=reason):
        open_segment(*forged(table, lines), SITE)


@pytest.mark.parametrize(
    "lines",
    [
        b'{"sequence": 1' + b"0" * 30 + b', "category": "event", "time": 1.0}\n',
        b'{"sequence": -1, "category": "event", "time": 1.0}\n',
        b'{"sequence": 1, "category": "\\ud800", "time": 1.0}\n',
    ],
)
def test_records_that_no_archive_can_hold_leave_the_rows_beside_them_alone(world: World, lines: bytes) -> None:
    name, data = forged(GOOD, lines)
    world.place.put(f"{SITE}/segments/{name}", data)
    (note,) = world.collect(START + DAY).notes
    assert "its records are not used" in note
    assert world.archived() == {START: 20.0}


@pytest.mark.parametrize(
    "changed",
    [
        {"end": "20000-01-01T00:00:00.000Z"},
        {"start": "-9999-01-01T00:00:00.000Z"},
        {"number": 0},
        {"telemetry": {"rows": 1, "sha256": hashlib.sha256(GOOD).hexdigest(), "units": {"air_temperature": "\ud800"}}},
    ],
)
def test_a_seal_that_says_what_cannot_be_is_set_aside(world: World, changed: dict[str, object]) -> None:
    name, data = forged(GOOD, b"", **changed)
    world.place.put(f"{SITE}/segments/{name}", data)
    (note,) = world.collect(START + DAY).notes
    assert "its seal cannot be read" in note
    assert world.collect(START + DAY).notes == []


def test_a_refused_segment_is_set_aside_receipted_and_holds_nothing_up(world: World, tmp_path: Path) -> None:
    world.run_days(0, 1)
    name, data = forged(GOOD, b"[1, 2]\n")
    world.place.put(f"{SITE}/segments/{name}", data)
    done = world.collect(START + DAY)
    assert len(done.notes) == 1
    assert "a list where an object" in done.notes[0]
    assert world.place.entries(f"{SITE}/segments") == []
    world.assert_complete()
