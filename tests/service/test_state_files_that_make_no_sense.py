"""Each file that the gateway remembers by, empty, cut, of another type, with values that make no sense: it starts."""

from __future__ import annotations

import contextlib
import copy
import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.edge.exchange.outbox import CHAIN_FILE, ChainState, Outbox
from igrow.edge.exchange.sealing import seal_due
from igrow.edge.guard.memory import note, recall
from igrow.edge.guard.readback import Readback
from igrow.edge.guard.state import GuardState, PointState, Write
from igrow.edge.hand_off import HandOff
from igrow.edge.image import Quality, Value
from igrow.edge.moment import Moment, to_json
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, AcknowledgementWatch, read_acknowledged
from igrow.edge.notifications.notifier import _read as read_told
from igrow.edge.page.password import PASSWORD_FILE, read_password
from igrow.edge.registers.loading import load_register_map
from igrow.edge.separating_tests.approval import Approval, approval_file, to_plain
from igrow.edge.sources.override import GrowerOverride
from igrow.edge.state_file import StateFile
from igrow.edge.store import SqliteStore, StoreLimits
from igrow.edge.store.ledger import NAMES
from igrow.edge.updates.state import UpdateState, load_state
from igrow.edge.updates.wishes import WISHES_FILE, read_wishes
from tests.control.control_fakes import image_of
from tests.control.daemon_bench import Plant, free_port, running, until, write_files
from tests.control.stubborn_plc import RULES
from tests.separating_tests.test_what_begins_and_ends_a_test import Gateway

NOW = 1_773_176_400.0
THEN = to_json(Moment("boot", 5.0, NOW - 60.0))
STRANGE: list[Any] = [None, True, -1, 1.5, "x", "", [], [1], {}, {"a": 1}, float("nan"), float("inf"), 10**400]


def strange(document: Any) -> Iterator[bytes]:
    """Yield the file whole, and in every way in which it may make no sense."""
    whole = json.dumps(document).encode()
    yield whole
    yield from (whole[:length] for length in (0, 1, len(whole) // 2, len(whole) - 1))
    yield from (
        b"\xff\xfe\x00\x80",
        b"[" * 100_000,
        b"null",
        b"3",
        b'"text"',
        b"[]",
        b"[[]]",
        b"NaN",
        b"\0" * len(whole),
    )
    for place in places(document):
        for value in STRANGE:
            changed = copy.deepcopy(document)
            part = changed
            for key in place[:-1]:
                part = part[key]
            part[place[-1]] = value
            yield json.dumps(changed).encode()


def places(document: Any) -> Iterator[tuple[Any, ...]]:
    """Yield the way to each value of a document, at any depth."""
    keys = document if isinstance(document, dict) else range(len(document)) if isinstance(document, list) else ()
    for key in keys:
        yield (key,)
        yield from ((key, *rest) for rest in places(document[key]))


def an_override(path: Path) -> None:
    override = GrowerOverride(StateFile(path, HandOff("state files")), "boot")
    for time in (0.0, 10.0, 10_000.0):
        override.offer(image_of(time, NOW + time))
        override.recipe_for(image_of(time, NOW + time))


def an_approval(path: Path) -> None:
    gateway = Gateway(path.parent)
    gateway.cycle(4)
    gateway.tests.describe()


def acknowledgements(path: Path) -> None:
    AcknowledgementWatch(StateFile(path, HandOff("state files")), lambda kind, **detail: None).look()
    read_acknowledged(path)


def bundles(path: Path) -> None:
    state = load_state(path)
    state.keep_up(NOW)
    json.dumps(asdict(state))
    assert all(name is None or isinstance(name, str) for name in (state.active, state.previous, state.candidate))


def the_chain(path: Path) -> None:
    store = SqliteStore(path.parent / "store", StoreLimits(survive_power_cut=False))
    store.append(NOW - 100_000.0, {"air_temperature": Value(20.0, Quality.GOOD, 0.0)})
    store.record_event(NOW, "x", {})
    store.close()
    seal_due(Outbox(path.parent, "greenhouse", "0"), path.parent / "store", NOW, 86_400)


FILES: dict[str, tuple[str, Any, Callable[[Path], object]]] = {
    "overrides": (
        "override.json",
        {
            "heating_setpoint": {"value": 19.0, "seconds": 60.0, "until": NOW, "seen": THEN, "by": "Anna", "asked": 3},
            "recipe": {"value": 0.0, "seconds": 60.0, "until": None, "seen": None, "by": "", "asked": None},
            "given_back_by": "Anna",
        },
        an_override,
    ),
    "an approved test": (
        approval_file(Path()).name,
        to_plain(Approval("vent_square_wave", "Anna", 7, 3600.0, Moment("boot", 5.0, NOW), Moment("boot", 6.0, NOW))),
        an_approval,
    ),
    "acknowledgements": (ACKNOWLEDGED_FILE, {"link": {"by": "Anna", "time": NOW}}, acknowledgements),
    "what was told": ("outbox.json", {"told": {"link": {"text": "x", "level": "warning", "at": NOW}}}, read_told),
    "bundles": (
        "state.json",
        asdict(
            UpdateState(
                "a", "b", "c", NOW, NOW, {"air_temperature": 0.5}, None, {"d": "bad"}, "", [(NOW, {"x": 0.5})], "a", NOW
            )
        ),
        bundles,
    ),
    "wishes": (WISHES_FILE, {"pinned": "a", "taken_back": "b"}, lambda path: read_wishes(path.parent)),
    "the chain": (
        CHAIN_FILE,
        asdict(ChainState("0a1b2c3d4e5f", 3, "d" * 64, int(NOW), 4, NOW, (NOW - 9.0, NOW), ((1, 2),))),
        the_chain,
    ),
    "the page's password": (
        PASSWORD_FILE,
        {"scheme": "scrypt", "salt": "00", "digest": "0" * 64, "n": 2**14, "r": 8, "p": 1},
        lambda path: read_password(path.parent),
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", FILES)
def test_a_file_that_makes_no_sense_stops_nobody(tmp_path: Path, what: str) -> None:
    name, document, use = FILES[what]
    for number, content in enumerate(strange(json.loads(json.dumps(document)))):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / name).write_bytes(content)
        try:
            use(folder / name)
        except Exception as error:
            pytest.fail(f"{content[:300]!r}: {type(error).__name__}: {error}")


def test_what_control_has_noted_may_make_no_sense() -> None:
    readback = Readback(RULES, confirm_within=60.0, respect_hand=600.0)
    readback.wrote(Write("heating_setpoint", 21.0, 21.0, "recipe", "", False), 5.0)
    memory = readback.points["co2_setpoint"]
    memory.stands, memory.hand, memory.held_until, memory.ceiling = 500.0, 500.0, 300.0, 640.0
    state = GuardState({"heating_setpoint": PointState(written=21.0, written_at=5.0)}, frozenset({"frost"}))
    document = json.loads(json.dumps(note(state, readback)))
    for content in strange(document):
        again = Readback(RULES, confirm_within=60.0, respect_hand=600.0)
        with contextlib.suppress(IgrowError):
            recall(parse_object(content, "the note"), again, 0.0, same=set(RULES), agree=True)
            again.observe(image_of(10.0, NOW, heating_setpoint=21.0, co2_setpoint=500.0, lamp_on=0.0))


@pytest.mark.parametrize("noted", ["", '{"at', "[]", "3", '{"points": [], "at": {"boot": "x", "monotonic": NaN}}'])
async def test_a_daemon_starts_whatever_the_one_before_has_noted(tmp_path: Path, noted: str) -> None:
    """What cannot be understood may have said that hands are respected: nothing is written for as long as that."""
    path, state = write_files(tmp_path, free_port(), respect_hand="1 h"), tmp_path / "state"
    plant = Plant(tmp_path, load_register_map(tmp_path / "map.yaml").buses["line"].port)
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles > 4)
    for name in NAMES:
        with closing(sqlite3.connect(state / "store" / name)) as ledger, ledger:
            assert ledger.execute("UPDATE records SET body = ? WHERE category = 'state'", (noted,)).rowcount > 0
    for name in ("override.json", "acknowledged.json", "separating_test.json", "updates/state.json"):
        (state / name).parent.mkdir(exist_ok=True)
        (state / name).write_text(noted)
    async with running(path) as daemon:
        await until(lambda: daemon.cycles > 4)
        assert not [alarm.text for alarm in daemon._journal.alarms.active if alarm.name.startswith("service")]
        await until(lambda: not [alarm for alarm in daemon._journal.alarms.active if alarm.name == "memory"])
        await until(lambda: plant.shows("heating_setpoint") == 19.0)
    await plant.down()
