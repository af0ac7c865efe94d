"""A separating test begins only where all is well, ends with whatever is not, and never runs twice."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from igrow.core.agronomy import Place
from igrow.core.effects import EFFECTS
from igrow.core.quantities import QUANTITIES
from igrow.core.separating_tests import SEPARATING_TESTS, SOURCE, climate_conditions, separating_tests_for
from igrow.core.site import Site
from igrow.edge.alarm_levels import Level
from igrow.edge.cycle_result import CycleResult
from igrow.edge.guard import Clamp, GuardState, Verdict
from igrow.edge.guard.interlocks import Force
from igrow.edge.hand_off import HandOff
from igrow.edge.image import Image
from igrow.edge.ports import SetpointStatus
from igrow.edge.records import AlarmRecord
from igrow.edge.separating_tests import SeparatingTests, approval_file
from igrow.edge.separating_tests.approval import Approval, read_approval, to_plain
from igrow.edge.separating_tests.runner import BEGAN_ANEW, COMPLETED
from igrow.edge.sources import Choice, Decision
from igrow.edge.state_file import StateFile, write_state
from tests.control.control_fakes import image_of

TEST = SEPARATING_TESTS["vent_square_wave"]
SITE = Site(name="greenhouse", latitude=52.0, longitude=4.5)
NIGHT = 1_773_176_400.0
"""10 March 2026, 21:00 UTC."""
CALM = {
    "wind_speed": 2.0, "outdoor_temperature": 9.0, "air_temperature": 18.0, "air_humidity": 80.0, "vent_lee": 0.0,
    "rain": 0.0,
}  # fmt: skip


class Gateway:
    """The daemon's side of a test, cycle by cycle."""

    def __init__(self, folder: Path) -> None:
        self.path = approval_file(folder)
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.aside = HandOff("files", patience=60.0, share=1.0)
        self.monotonic = 0.0
        self.values = dict(CALM)
        self.result: dict[str, Any] = {}
        self.alarms: list[AlarmRecord] = []
        self.start()

    def start(self) -> None:
        """A new process."""
        crop = SITE.crop
        climate = climate_conditions(crop.temperature_low, crop.temperature_high, crop.humidity_high)
        self.tests = SeparatingTests(
            StateFile(self.path, self.aside),
            {TEST.name: TEST},
            {TEST.name: (*TEST.conditions, *climate)},
            ("heating_setpoint",),
            Place.of(SITE),
            "boot",
            lambda kind, **detail: self.events.append((kind, detail)),
        )

    def approve(self, seconds: float = 86_400.0) -> None:
        write_state(self.path, to_plain(Approval(TEST.name, "Anna", 1 + len(self.events), seconds)))

    def cycle(self, count: int = 1) -> dict[str, float]:
        """Run cycles of a minute; return what the last one asked of the vents."""
        lent: dict[str, float] = {}
        for _ in range(count):
            self.monotonic += 60.0
            image = self.image()
            lent = dict(self.tests.offer(image).lent)
            choices = {name: Choice(value, SOURCE, "") for name, value in lent.items()} | self.result.get("choices", {})
            verdict = Verdict((), self.result.get("clamps", ()), GuardState(), self.result.get("engaged", ()))
            statuses = self.result.get("statuses", {})
            self.tests.tick(CycleResult(image, Decision(choices, "recipe", ""), verdict, statuses, 0.0), self.alarms)
        return lent

    def image(self) -> Image:
        return image_of(self.monotonic, NIGHT + self.monotonic, **self.values)

    def kinds(self) -> list[str]:
        return [kind.removeprefix("separating_test_") for kind, _ in self.events]

    @property
    def why(self) -> str:
        return str(self.events[-1][1]["why"])


@pytest.fixture
def gateway(tmp_path: Path) -> Gateway:
    return Gateway(tmp_path)


def test_every_definition_holds_together() -> None:
    for name, test in SEPARATING_TESTS.items():
        assert name == test.name
        assert set(test.separates) <= set(EFFECTS)
        assert all(set(stage.values) == set(test.points) and stage.minutes >= 5.0 for stage in test.course)
        for point in test.points:
            assert all(QUANTITIES[point].holds(value) for value in test.span(point))
        assert test.at(-0.0) == test.course[0].values
        assert test.at(test.minutes - 0.1) == test.course[-1].values
        assert test.at(test.minutes) is None
        assert all(condition.quantity in QUANTITIES for condition in test.conditions)
        assert test in separating_tests_for((test.separates[0], "lamp_heat"))
    assert separating_tests_for(("vent_backlash",)) == ()


def test_nothing_is_asked_without_an_approval(gateway: Gateway) -> None:
    assert gateway.cycle(5) == {}
    assert gateway.events == []


def test_an_approved_test_runs_its_course_once(gateway: Gateway) -> None:
    gateway.approve()
    assert gateway.cycle(3) == {}, "it begins once the file says that it has"
    assert gateway.kinds() == ["approved", "began"]
    assert gateway.cycle() == {"vent_lee": 15.0}
    assert gateway.cycle(30) == {"vent_lee": 5.0}
    assert gateway.cycle(400) == {}
    assert gateway.kinds() == ["approved", "began", "ended"]
    assert gateway.why == COMPLETED
    assert read_approval(gateway.path).ended == COMPLETED  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("quantity", "waits", "ends"),
    [
        ("wind_speed", 6.0, 9.0),
        ("outdoor_temperature", 1.0, -1.0),
        ("rain", 0.5, 0.5),
        ("air_temperature", 14.0, 12.0),
        ("air_temperature", 31.5, 33.0),
        ("air_humidity", 92.0, 94.0),
    ],
)
def test_weather_and_climate_keep_it_from_beginning_and_end_it(
    gateway: Gateway, quantity: str, waits: float, ends: float
) -> None:
    gateway.values[quantity] = waits
    gateway.approve()
    gateway.cycle(10)
    assert gateway.kinds() == ["approved"]
    assert quantity in str(gateway.tests.describe()["waits_for"])
    gateway.values = dict(CALM)
    assert gateway.cycle(5) == {"vent_lee": 15.0}
    if quantity != "rain":
        gateway.values[quantity] = waits
        assert gateway.cycle(5) == {"vent_lee": 15.0}, "what only keeps it from beginning does not end it"
    gateway.values[quantity] = ends
    assert gateway.cycle() == {}, "in the very cycle"
    assert quantity in gateway.why


HINDRANCES: dict[str, dict[str, Any]] = {
    "an override": {"choices": {"heating_setpoint": Choice(16.0, "override", "")}},
    "a hand": {"statuses": {"heating_setpoint": SetpointStatus(None, None, None, "", "", held_until=1e9)}},
    "an interlock": {"engaged": (Force("wind", {}, "wind_speed 20, above 15"),)},
}


@pytest.mark.parametrize("what", HINDRANCES)
def test_people_and_interlocks_come_first(gateway: Gateway, what: str) -> None:
    gateway.approve()
    gateway.result = HINDRANCES[what]
    gateway.cycle(10)
    assert gateway.kinds() == ["approved"]
    gateway.result = {}
    assert gateway.cycle(4) == {"vent_lee": 15.0}
    gateway.result = HINDRANCES[what]
    gateway.cycle()
    assert gateway.cycle() == {}
    assert gateway.kinds()[-1] == "ended"


def test_an_alarm_ends_it_a_notice_does_not(gateway: Gateway) -> None:
    gateway.approve()
    alarm = AlarmRecord(None, 0.0, "too_cold", active=True, text="too cold", level=Level.NOTICE)
    gateway.alarms = [alarm]
    assert gateway.cycle(5) == {"vent_lee": 15.0}
    gateway.alarms = [replace(alarm, level=Level.WARNING)]
    gateway.cycle()
    assert gateway.cycle() == {}
    assert "too cold" in gateway.why


@pytest.mark.parametrize(
    ("kind", "ends"), [("limit", True), ("crop", True), ("slew", False), ("minimum_interval", False)]
)
def test_a_course_that_the_guard_changes_is_over(gateway: Gateway, kind: str, ends: bool) -> None:
    gateway.approve()
    gateway.cycle(4)
    gateway.result = {"clamps": (Clamp("vent_lee", 15.0, 10.0, "so it is", kind, SOURCE),)}
    gateway.cycle()
    assert (gateway.cycle() == {}) is ends


def test_a_lost_sensor_ends_it(gateway: Gateway) -> None:
    gateway.approve()
    gateway.cycle(4)
    del gateway.values["wind_speed"]
    assert gateway.cycle() == {}
    assert gateway.why == "wind_speed cannot be believed"


def test_a_test_that_nobody_watches_ends(gateway: Gateway) -> None:
    """A fault in the part that watches gives the plant back."""
    gateway.approve()
    gateway.cycle(4)
    assert gateway.tests.offer(gateway.image()).lent
    assert not gateway.tests.offer(gateway.image()).lent
    assert gateway.why == "nobody watched over it"


def test_a_restart_does_not_go_on_with_it(gateway: Gateway) -> None:
    gateway.approve()
    assert gateway.cycle(5) == {"vent_lee": 15.0}
    gateway.start()
    assert gateway.cycle(20) == {}
    assert gateway.why == BEGAN_ANEW
    gateway.start()
    assert gateway.cycle(20) == {}
    assert gateway.kinds() == ["approved", "began", "ended"]


def test_a_restart_before_its_beginning_costs_nothing(gateway: Gateway) -> None:
    gateway.values["wind_speed"] = 7.0
    gateway.approve()
    gateway.cycle(5)
    gateway.start()
    gateway.values = dict(CALM)
    assert gateway.cycle(5) == {"vent_lee": 15.0}
    assert gateway.kinds() == ["approved", "began"]


def test_an_approval_lapses(gateway: Gateway) -> None:
    gateway.values["wind_speed"] = 7.0
    gateway.approve(seconds=600.0)
    gateway.cycle(15)
    gateway.values = dict(CALM)
    assert gateway.cycle(5) == {}
    assert gateway.kinds() == ["approved", "ended"]
    assert "did not come in time" in gateway.why


def test_it_needs_a_whole_night_and_a_clock(gateway: Gateway) -> None:
    gateway.approve()
    gateway.monotonic = 6.0 * 3600.0  # three in the morning: four hours of dark are not left
    gateway.cycle(5)
    assert "too short" in str(gateway.tests.describe()["waits_for"])
    gateway.monotonic = 14.0 * 3600.0
    gateway.cycle(5)
    assert "it is no night" in str(gateway.tests.describe()["waits_for"])


def test_a_file_that_cannot_be_written_begins_nothing(gateway: Gateway, monkeypatch: pytest.MonkeyPatch) -> None:
    gateway.approve()
    monkeypatch.setattr(StateFile, "answer", lambda *_: None)
    assert gateway.cycle(50) == {}
    assert gateway.kinds() == ["approved"]


@pytest.mark.parametrize(
    "content", ["", "[]", "{", '{"test": 3}', json.dumps({"test": "x", "asked": "y", "seconds": []})]
)
def test_a_broken_file_is_no_approval(gateway: Gateway, content: str) -> None:
    gateway.path.write_text(content)
    assert gateway.cycle(5) == {}
    assert gateway.events == []


def test_a_file_that_is_broken_while_a_test_runs_ends_it_only_when_it_stays_so(gateway: Gateway) -> None:
    gateway.approve()
    gateway.cycle(5)
    whole = gateway.path.read_bytes()
    gateway.path.write_bytes(whole[: len(whole) // 2])
    assert gateway.cycle(5)
    gateway.path.write_bytes(whole)
    assert gateway.cycle(5)
    gateway.path.write_bytes(whole[: len(whole) // 2])
    assert gateway.cycle(12) == {}
    assert gateway.why == "nobody can read whether it was withdrawn"
