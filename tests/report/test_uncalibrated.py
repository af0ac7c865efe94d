"""A bundle that was never calibrated on the greenhouse: that is said first, with the command that mends it."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from igrow.core.effects import EFFECTS
from igrow.core.language import LANGUAGES, speak
from igrow.trainer.cli import main
from igrow.trainer.diagnosis import Diagnosis
from igrow.trainer.diagnosis.answer.uncalibrated import FIRST, NO_NAME, how_to_calibrate
from igrow.trainer.report import render_report
from igrow.trainer.report.page import priced

pytestmark = pytest.mark.usefixtures("without_pictures")
TYPED = ("my log.csv", "--site", "tunnel.yaml")
COMMAND = "igrow-trainer calibrate 'my log.csv' --site tunnel.yaml --fit-weeks 4 --out bundle"


@pytest.fixture
def elsewhere(leak: Diagnosis) -> Diagnosis:
    """The leak, by a bundle of another greenhouse."""
    return replace(leak, model=replace(leak.model, calibrated_on="default"))


def misfitting(diagnosis: Diagnosis) -> Diagnosis:
    stages = dict.fromkeys(("deployed", "recalibrated", "corrected"), 35.0)
    return replace(diagnosis, errors={**diagnosis.errors, "air_humidity": {"24_h": stages}})


@pytest.mark.slow
def test_that_it_was_never_calibrated_here_comes_before_the_verdict(elsewhere: Diagnosis) -> None:
    lines = elsewhere.summary(TYPED).splitlines()
    assert lines[0] == FIRST
    assert lines[1].endswith(COMMAND)
    assert lines[2] == "virtual: named"
    main_part = re.sub(r"<[^>]+>", "", render_report(elsewhere, typed=TYPED).partition("<main>")[2])
    said = [line for line in main_part.splitlines() if line.strip()]
    assert said[0] == FIRST.replace("'", "&#39;")
    assert said[1].endswith(COMMAND.replace("'", "&#39;"))
    assert said[2] == "This greenhouse differs from the bundle&#39;s in something that has a name."


@pytest.mark.parametrize("verdict", ["nothing", "named", "ambiguous", "unexplained"])
@pytest.mark.parametrize("code", LANGUAGES)
def test_no_verdict_of_it_says_that_something_broke_or_fits(elsewhere: Diagnosis, verdict, code: str) -> None:
    page = render_report(replace(elsewhere, verdict=verdict), code)
    calibrated = render_report(replace(elsewhere, verdict=verdict, model=elsewhere.corrected), code)
    told = re.search(r'class="lead verdict \w+">([^<]*)<', page)
    assert told is not None
    assert told[1] not in calibrated
    assert speak(code).text(FIRST).partition(":")[0].replace("'", "&#39;") in page
    assert speak(code).text(FIRST).partition(":")[0].replace("'", "&#39;") not in calibrated


def test_a_model_of_another_greenhouse_that_does_not_fit_is_sure_of_no_name(leak: Diagnosis, elsewhere) -> None:
    assert (elsewhere.settled().verdict, elsewhere.exit_code) == ("named", 10)
    unsure = misfitting(elsewhere).settled()
    assert (unsure.verdict, unsure.exit_code, unsure.to_json()["verdict"]) == ("ambiguous", 11, "ambiguous")
    assert NO_NAME in unsure.summary()
    assert NO_NAME in render_report(unsure)
    assert misfitting(leak).settled().verdict == "named"


def test_a_difference_between_two_greenhouses_costs_nothing(leak: Diagnosis, elsewhere: Diagnosis) -> None:
    assert "EUR" in render_report(leak)
    assert "EUR" not in render_report(elsewhere)
    assert priced(elsewhere)["findings"][0]["eur_per_week"] is None
    assert (priced(elsewhere)["calibrated_here"], priced(leak)["calibrated_here"]) == (False, True)


@pytest.mark.parametrize(("days", "weeks"), [(60.0, 4), (35.0, 4), (34.99, 3), (28.0, 3)])
def test_the_command_leaves_a_week_to_diagnose(days: float, weeks: int) -> None:
    text, command = how_to_calibrate(days, TYPED)
    assert f"--fit-weeks {weeks} " in command
    assert "all was well" in text


def test_of_a_short_log_it_is_said_how_long_it_must_be() -> None:
    text, command = how_to_calibrate(27.99)
    assert "five weeks" in text
    assert command == "igrow-trainer calibrate LOG --site site.yaml --fit-weeks 4 --out bundle"


def test_a_data_fault_comes_before_any_calibration(stuck: Diagnosis) -> None:
    fault = replace(stuck, model=replace(stuck.model, calibrated_on="default"))
    assert not fault.uncalibrated
    assert FIRST not in fault.summary()


def test_the_command_that_is_told_reads_the_log_as_this_one_did(monkeypatch, tmp_path, leak, elsewhere, capsys) -> None:
    monkeypatch.setattr("igrow.trainer.cli.diagnose.diagnose", lambda *_, **__: replace(elsewhere, findings=()))
    monkeypatch.setattr("igrow.trainer.cli.diagnose.log_of", lambda _: leak.log)
    given = ["a.csv", "b.csv", "--site", "s.yaml", "--mapping", "m.yaml", "--accept", "clock"]
    assert main(["diagnose", *given, "--out", str(tmp_path)]) == 10
    assert f"igrow-trainer calibrate {' '.join(given)} --fit-weeks" in capsys.readouterr().out
    assert f"igrow-trainer calibrate {' '.join(given)} --fit-weeks" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("code", LANGUAGES)
def test_how_a_cause_shows_is_told_in_the_language_of_the_report(leak: Diagnosis, code: str) -> None:
    """It stood there in English alone."""
    english = EFFECTS["wind_infiltration"].signature
    page = render_report(leak, code)
    told = speak(code).text(english)
    assert f"{told[0].upper()}{told[1:]}" in page
    assert (english[1:] in page) == (code == "en")
