"""Every text that people read stands in every language, with the same places for what is put in."""

from __future__ import annotations

import re

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.language import LANGUAGES, speak
from igrow.core.language.names import NAMES
from igrow.core.language.sentences import PLACE
from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.design.candidates import patterns
from igrow.trainer.report import sentences
from tests.diagnosis.conftest import greenhouse_log
from tests.language.catalogues import catalogue, compiled, locales, messages, numbered
from tests.language.catalogues import sentences as put_together
from tests.needs import ROOT

OTHERS = LANGUAGES[1:]


@pytest.fixture(scope="module")
def texts() -> list[str]:
    return messages()


@pytest.mark.parametrize("code", OTHERS)
def test_no_message_is_untranslated(code: str, texts: list[str]) -> None:
    known = catalogue(code)
    lacking = [text for text in texts if (found := known.get(text)) is None or not found.string or found.fuzzy]
    assert lacking == [], "make translations adds them"
    gone = [str(one.id) for one in known if one.id and one.id not in texts]
    assert gone == []


@pytest.mark.parametrize("code", OTHERS)
def test_a_translation_has_the_same_places_as_its_text(code: str) -> None:
    for one in catalogue(code):
        if one.id:
            ours, theirs = (set(re.findall(r"\{\w+\}", str(text))) for text in (one.id, one.string))
            # What English needs a place for, such as an s behind a number, another language may not.
            assert theirs == ours or (re.search(r"\{\d\}s?\{|\{\d\} reading", str(one.id)) and theirs < ours), one.id


def test_everything_that_a_report_may_name_has_a_text(texts: list[str]) -> None:
    assert len(texts) > 250
    assert set(QUANTITIES) <= set(NAMES)
    assert {driver for effect in EFFECTS.values() for driver in effect.drivers} <= set(NAMES)
    assert {effect.title for effect in EFFECTS.values()} <= set(texts)


@pytest.mark.parametrize("code", OTHERS)
def test_every_pattern_in_time_is_told_in_every_language(code: str) -> None:
    record = greenhouse_log(1, days=8).record()
    spoken = speak(code)
    names = [when for when, _, _ in patterns(record, 4.5)]
    assert len(names) > 40
    for name in names:
        told = sentences.when(f"heat: {name}", 1.0, spoken)
        assert not re.search(r"working|weather|day|lamp_|after|wind_| to ", told), (name, told)


def test_a_day_is_the_day_of_the_greenhouse() -> None:
    midnight = np.datetime64("2020-03-01T23:30:00", "s")
    assert speak("de", "Europe/Amsterdam").day(midnight) == "2. März 2020"
    assert speak("en").day(midnight) == "1 March 2020"
    assert speak("en").moment(midnight) == "1 Mar 2020 23:30"
    assert speak("zh").moment(midnight) == "2020年3月1日 23:30"


def test_no_text_hides_in_an_f_string_where_nobody_finds_it() -> None:
    for folder in ("trainer/data", "trainer/diagnosis", "trainer/report", "igrow_core/language", "edge/page"):
        for path in (ROOT / folder).rglob("*.py"):
            assert not re.search(r"""f(["']).*\{[\w.]*(?:text|N_)\(["'].*\1""", path.read_text()), path


@pytest.mark.parametrize("code", OTHERS)
def test_what_a_gateway_reads_was_compiled_from_what_people_wrote(code: str) -> None:
    assert (ROOT / "igrow_core" / "language" / f"{code}.mo").read_bytes() == compiled(code), "make translations"


def test_numbers_dates_and_places_are_those_of_the_library_and_of_the_code() -> None:
    folder = ROOT / "igrow_core" / "language"
    assert (folder / "locales.json").read_text() == locales(), "make translations"
    assert (folder / "sentences.json").read_text() == numbered(), "make translations"


def test_numbers_are_written_as_the_language_does() -> None:
    assert [speak(code).number(1234.5, 5) for code in LANGUAGES] == [
        "1,234.5",
        "1.234,5",
        "1.234,5",
        "1.234,5",
        "1,234.5",
    ]
    assert speak("de").fixed(-0.04, 1) == "0,0"


@pytest.mark.parametrize("code", OTHERS)
def test_every_sentence_that_is_put_together_is_told_by_its_own_text(code: str) -> None:
    spoken = speak(code)
    for message in put_together():
        line, expected = (PLACE.sub(lambda place: f"{1000 + 7 * int(place[0][1:-1])}", text)
                          for text in (message, spoken.text(message)))  # fmt: skip
        if re.search(r"\}\{|\} \{", message):  # where one value ends and the next begins is not to be seen
            continue
        assert spoken.told(line) == expected, message


def test_a_line_within_a_line_is_told_and_what_is_not_ours_is_left() -> None:
    spoken = speak("de")
    told = spoken.told("planning: no plan was made: it needs more than 512 MiB")
    assert told == "Planung: es wurde kein Plan gemacht: es braucht mehr als 512 MiB"
    assert spoken.told("exchange: Errno 113 of a stranger's program") == "Austausch: Errno 113 of a stranger's program"
    assert spoken.told("") == ""


def test_an_american_unit_leads_there_and_back() -> None:
    us = speak("en", units="us")
    assert us.amount(20.0, "degC", 3) == "68 °F"
    assert us.amount(5.0, "K", 3) == "9 °F"
    assert us.amount(10.0, "m s-1", 3) == "22.4 mph"
    assert us.amount(1000.0, "m2", 3) == "10,800 ft²"
    assert us.amount(300.0, "W m-2", 3) == "300 W/m²"
    for unit in ("degC", "K", "m s-1", "kg m-2"):
        assert us.shown(unit).back(us.shown(unit).of(12.5)) == pytest.approx(12.5)
