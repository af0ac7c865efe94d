"""The page in each language: nothing on it stays English; numbers and dates are the language's, units the site's."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from igrow.core.language import LANGUAGES, speak
from igrow.core.quantities import ACTUATORS, CLIMATE, SETPOINTS, WEATHER
from igrow.edge.configuration import load_configuration
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page.actions import Actions
from igrow.edge.page.history import Course
from igrow.edge.page.http import Request
from igrow.edge.page.pages import render
from igrow.edge.page.sessions import Session
from igrow.edge.page.state import Heard
from igrow.edge.page.view import Known, compose
from igrow.edge.page.words import Words
from igrow.edge.separating_tests import Approval
from igrow.edge.sources.override import Lease, read_leases
from igrow.edge.updates.worsening import Worsening, worsening_sentence
from tests.language.catalogues import catalogue
from tests.page.page_bench import CONFOUNDED, NOW, TESTS, alarm, clamp, plan, state, write_greenhouse

OTHERS = LANGUAGES[1:]
ENGLISH_WORDS = re.compile(
    r"\b(the|is|are|was|were|of|and|to|not|for|with|from|until|by|than|your|which|what|it|nothing|more|less|above|below|"
    r"plan's|limit|setpoint is|temperature is|written|setting|unknown|sensor is)\b",
    re.IGNORECASE,
)
OWN = {"nl": {"is", "of", "for", "was", "plan's"}, "de": {"was"}, "es": set(), "zh": set()}
"""Words that another language has too."""
LIMITED = "100 % was written to lamp_on, but the PLC shows 0 %: it seems to have a limit of its own there"
BACK = "back to 20 degC, set by hand at the PLC and respected for 35 min more"
RAMP = "above the limit of 28 degC; slew of 4 K per hour on the way to 28 degC"
DARK = "90 umol m-2 s-1 with no sun and no lamps"
WORSE = Worsening("air_temperature", NOW - 86_400.0, 0.5, 1.5)
AMERICAN = "\nunits: us\n"


def everything() -> dict[str, Any]:
    """A state in which the daemon says much of what it can say."""
    said = state(
        source="last_plan",
        why="the last valid plan, of 14 Mar 15:00 UTC, until 14 Mar 21:00 UTC "
        "(a plan newer than 14 Mar 15:00 UTC is overdue)",
        alarms=[
            *state()["alarms"],
            alarm("climate too_cold", "too cold: air_temperature for 15 min below 13 degC, now 9.5 degC", "critical"),
            alarm("interlock storm", "interlock storm rules vent_wind: a storm breaks open vents", "notice"),
            alarm("write lamp_on", LIMITED, "warning"),
            alarm("simulator", worsening_sentence([WORSE]), "notice"),
            alarm("link", "no point of the PLC can be read: check cable, address and power", "critical"),
        ],
        clamps=[
            *state()["clamps"],
            clamp("co2_setpoint", 900.0, 400.0, "interlock wind: wind_speed 21 m s-1, above 18 m s-1"),
            clamp("heating_setpoint", 21.0, 20.0, BACK),
            clamp("heating_setpoint", 31.0, 28.0, RAMP),
            clamp("heating_setpoint", 23.0, 22.0, "the crop's mean_temperature"),
            clamp("co2_setpoint", 900.0, 850.0, "written 20 s ago, at least 300 s apart; the crop's temperature_drift"),
        ],
        problems=["the disk is full", "planning: no plan was made: it needs more than 512 MiB"],
        plan=plan(note="planned with the weather that is usual at this date: the forecast: not read within 5 s",
                  problem="no new plan while wind_speed is frozen", leaves_range=True),
        clock_ok=False,
    )  # fmt: skip
    said["values"]["air_humidity"] = {"value": 79.0, "quality": "stale", "age": 300.0, "why": "last read 300 s ago"}
    said["values"]["par"] = {
        "value": 79.0,
        "quality": "implausible",
        "age": 3.0,
        "why": "90 umol m-2 s-1 with no sun and no lamps",
    }
    said["setpoints"]["lamp_on"]["held_until"] = said["monotonic"] + 5400.0
    said["bundle"] |= {"shadow_until": NOW + 7200.0, "candidate": "b-2", "refusal": "refused [x]"}
    said["bundle"]["confounded"] = [CONFOUNDED, ["co2_offset", "photosynthesis_decline"]]
    said["separating_test"] = {
        "test": "vent_square_wave", "by": "Anna", "running": False, "ended": "",
        "waits_for": "the guard held vent_lee back: above the limit of 60 %",
    }  # fmt: skip
    said["setpoints"]["co2_setpoint"] |= {
        "source": "separating_test",
        "why": "the separating test dosing_pause, for 20 min more",
    }
    return said


def shown(folder: Path, code: str, heard: Heard, site: str = "", ended: str = "") -> str:
    """What people read of the page, and what is read to them."""
    configuration = load_configuration(write_greenhouse(folder, TESTS, site))
    times = np.arange(NOW - 86_400.0, NOW, 300.0)
    names = (*CLIMATE, *SETPOINTS, *ACTUATORS, *WEATHER)
    courses = {name: Course(times, *[np.linspace(14.0, 30.0, len(times))] * 3) for name in names}
    leases = {name: Lease(18.0, 7200.0, NOW + 3600.0, by="Anna") for name in ("heating_setpoint", "recipe")}
    approval = Approval("vent_square_wave", "Anna", 1, 86_400.0, ended=ended)
    known = Known(configuration, heard, NOW, "day", courses, courses, "", leases,
                  {"link": Acknowledgement("Anna", NOW - 60.0)}, True, code, approval)  # fmt: skip
    content = {**compose(known), "session": Session("Anna", b"", NOW), "said": "", "said_well": True}
    return text_of(render("page.html", content).body.decode())


def text_of(page: str) -> str:
    spoken = re.sub(r'<[^>]*?(?:aria-label|title)="([^"]*)"[^>]*>', r" \1 ", page)
    return html.unescape(re.sub(r"<code>.*?</code>|<[^>]*>", "\n", spoken))


@pytest.mark.parametrize("code", OTHERS)
@pytest.mark.parametrize(
    "ended",
    [
        "it ran to its end", "withdrawn by Anna", "wind_speed is 8.3, above 8", "air_humidity cannot be believed",
        "vent_lee shows 3 %, not the 15 % that was written", "its weather did not come in time",
        "the guard held vent_lee back: above the limit of 10 %", "the PLC does not answer",
        "an interlock is engaged: storm", "the clock is wrong",
        "control began anew while it ran: the daemon was started, or read its configuration, again",
        "an alarm: wind_speed is frozen: exactly 4.1 m s-1 for 0.7 h", "what is left of the night is too short",
    ],
)  # fmt: skip
def test_how_a_separating_test_ended_is_told_in_every_language(tmp_path: Path, code: str, ended: str) -> None:
    heard = Heard(state(bundle={"name": "b", "confounded": [CONFOUNDED]}))
    text = shown(tmp_path, code, heard, ended=ended)
    assert speak(code).text("Approve it, for one run") in text
    last = speak(code).text("The last test, {test}, has ended: {why}").partition("{test}")[0]
    line = next(line for line in text.splitlines() if last in line)
    assert set(map(str.lower, ENGLISH_WORDS.findall(line))) <= OWN[code]
    assert ended not in line


@pytest.mark.parametrize("code", OTHERS)
@pytest.mark.parametrize(
    "heard",
    [
        Heard(everything()), Heard(state()), Heard(state(plan=None, clamps=[], bundle={}, link_ok=False)),
        Heard(state(), "no daemon answers on port 8420 of this machine; is igrow-edge running?", 90.0), Heard(None),
    ],
    ids=["much to say", "calm", "not heard", "silent", "never heard"],
)  # fmt: skip
def test_nothing_on_the_page_stays_english(tmp_path: Path, code: str, heard: Heard, caplog) -> None:
    text = shown(tmp_path, code, heard)
    assert "cannot be shown" not in caplog.text
    left = [line.strip() for line in text.splitlines()
            if (found := ENGLISH_WORDS.findall(line)) and set(map(str.lower, found)) - OWN[code]]  # fmt: skip
    assert left == []
    # Not one text of the catalogue stands there in English, but for those that the language writes alike.
    for one in catalogue(code):
        message = str(one.id)
        if len(message) > 12 and " " in message and "{" not in message and message != one.string:
            assert message not in text, message
    assert "{" not in text


def test_the_same_page_in_english_is_found_out(tmp_path: Path) -> None:
    """The test above can fail: what it looks for is there in English."""
    text = shown(tmp_path, "en", Heard(everything()))
    assert len(ENGLISH_WORDS.findall(text)) > 100


def test_numbers_dates_and_names_are_those_of_the_language(tmp_path: Path) -> None:
    text = shown(tmp_path, "de", Heard(state()))
    for said in ("Samstag, 14. März 2026, 16:00", "21,3", "1.000 m²", "38,00 €", "Luftfeuchte", "Der Plan entscheidet"):
        assert said in text, said
    assert "2026年3月14日星期六, 16:00" in shown(tmp_path, "zh", Heard(state()))


def test_an_american_site_is_told_in_its_units_and_asks_in_them(tmp_path: Path) -> None:
    text = shown(tmp_path, "en", Heard(everything()), AMERICAN)
    for said in (
        "70.3",
        "°F",
        "53.6 to 82.4 °F",
        "below 55.4 °F, now 49.1 °F",
        "Above the limit of 82.4 °F; slew of 7.2 °F per hour on the way to 82.4 °F",
        "Back to 68 °F, set by hand",
        "wind speed 46.98 mph, above 40.26 mph",
        "exactly 9.171 mph for 0.7 h",
        "air temperature 0.9 °F -> 2.7 °F",
        "10,760 ft²",
        "crop: no hotter than 89.6 °F",
    ):
        assert said in text, said
    assert "°C" not in text
    assert "degC" not in text


def test_what_is_typed_in_is_in_the_unit_that_is_shown(tmp_path: Path) -> None:
    configuration = load_configuration(write_greenhouse(tmp_path, site=AMERICAN))
    actions = Actions(configuration, (), Words.of(configuration.site, "en"))
    form = {"do": "override", "setpoint": "heating_setpoint", "value": "68", "hours": "2"}
    assert (
        actions.do(form, "Anna") == "Heating setpoint: 68.0 °F by hand for 2 h. The PLC shows it after the next cycles."
    )
    assert read_leases(tmp_path / "state" / "override.json")["heating_setpoint"].value == pytest.approx(20.0)
    # The limit as it is shown is the limit.
    actions.do(form | {"value": "82.4"}, "Anna")
    assert read_leases(tmp_path / "state" / "override.json")["heating_setpoint"].value == pytest.approx(28.0)


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        ("de-AT,de;q=0.9,en;q=0.8", "de"), ("fr;q=1,nl;q=0.4,es;q=0.7", "es"), ("", "en"), ("fr", "en"),
        ("de;q=0,zh-CN;q=0.1", "zh"), ("de;q=x, nl", "nl"), ("*", "en"),
    ],
)  # fmt: skip
def test_a_browser_is_answered_in_the_language_that_it_likes_best(asked: str, code: str) -> None:
    request = Request("GET", "/", {}, {"accept-language": asked}, b"", "127.0.0.1")
    assert request.language(LANGUAGES) == code


def test_speech_of_a_site_keeps_its_units() -> None:
    assert replace(speak("en"), units="us").unit("degC") == "°F"
