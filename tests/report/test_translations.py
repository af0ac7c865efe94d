"""Every text that people read stands in every language, with the same places for what is put in."""

from __future__ import annotations

import re

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.candidates import patterns
from igrow.trainer.language import LANGUAGES, speak
from igrow.trainer.language.messages import catalogue, messages
from igrow.trainer.language.names import NAMES
from igrow.trainer.report import sentences
from tests.diagnosis.conftest import greenhouse_log
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
            assert sorted(re.findall(r"\{\w+\}", str(one.id))) == sorted(re.findall(r"\{\w+\}", str(one.string))), (
                one.id
            )


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
    assert speak("en").day(midnight) == "March 1, 2020"
    assert speak("en").moment(midnight) == "1 Mar 2020 23:30"
    assert speak("zh").moment(midnight) == "2020年3月1日 23:30"


def test_no_text_hides_in_an_f_string_where_nobody_finds_it() -> None:
    for folder in ("data", "diagnosis", "language", "report"):
        for path in (ROOT / "trainer" / folder).rglob("*.py"):
            assert not re.search(r"""f(["']).*\{[\w.]*(?:text|N_)\(["'].*\1""", path.read_text()), path
