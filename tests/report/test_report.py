"""What the report says: the best is what is best, money, rivals, checks, what does not fit, what cannot be judged."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.language import LANGUAGES, speak
from igrow.core.language.units import US, written
from igrow.core.quantities import QUANTITIES
from igrow.trainer.data import Log
from igrow.trainer.data.plausibility import find_faults
from igrow.trainer.data.plot import plot_log
from igrow.trainer.diagnosis import Diagnosis
from igrow.trainer.diagnosis.answer import plots
from igrow.trainer.diagnosis.open_vents import OpenVents
from igrow.trainer.report import render_report, sentences, verdicts, write_diagnosis
from igrow.trainer.report.page import error_rows
from igrow.trainer.report.worth import Worth, worth
from tests.diagnosis.conftest import greenhouse_log


def with_errors(result: Diagnosis, quantity: str, **stages: float) -> Diagnosis:
    return replace(result, errors={**result.errors, quantity: {"24_h": stages}})


def row_of(page: str, quantity: str) -> list[str]:
    """Return the classes of a row's three cells of errors."""
    row = re.search(rf'<th scope="row">{quantity}</th><td>24 hours</td>(.*?)</tr>', page)
    assert row is not None
    return ["best" if 'class="best"' in cell else "" for cell in re.findall(r"<td[^>]*>", row[1])[:3]]


def best_of(result: Diagnosis) -> list[bool]:
    """Return which of the three errors of the air temperature is marked."""
    return [best for _, best in next(error_rows(result, speak("en"))).cells]


def test_the_best_column_is_the_one_that_is_best(leak: Diagnosis, page: str) -> None:
    assert row_of(page, "air temperature") == ["", "", "best"]
    worse = with_errors(leak, "air_temperature", deployed=0.3, recalibrated=0.2, corrected=0.4)
    assert best_of(worse) == [False, True, False]
    same = with_errors(leak, "air_temperature", deployed=0.2, recalibrated=0.2, corrected=0.2)
    assert best_of(same) == [False, False, False]


def test_where_correction_makes_it_worse_it_is_said(leak: Diagnosis) -> None:
    said = list(
        sentences.gains(with_errors(leak, "air_co2", deployed=20.0, recalibrated=19.0, corrected=31.0), speak("en"))
    )
    assert "CO2: correction makes predictions a day ahead worse: off by 31 ppm, before by 20 ppm." in said
    half = with_errors(leak, "air_co2", deployed=20.0, recalibrated=15.0, corrected=18.0)
    said = list(sentences.gains(half, speak("en")))
    assert "CO2: recalibration alone would be better, off by 15 ppm." in said


@pytest.mark.parametrize("verdict", ["nothing", "named", "ambiguous", "unexplained"])
def test_no_verdict_says_that_a_model_fits_where_its_errors_say_that_it_does_not(leak: Diagnosis, verdict: Any) -> None:
    good = replace(leak, verdict=verdict)
    bad = with_errors(good, "air_humidity", deployed=35.0, recalibrated=35.0, corrected=35.0)
    # Where nothing was found it is the model in force that stands, which lacks the leak and fits nothing here.
    assert [one.quantity for one in bad.misfits if verdict != "nothing" or one.quantity == "air_humidity"] == [
        "air_humidity"
    ]
    assert "does not fit" in verdicts.verdict(bad, speak("en")) or "none makes it fit" in verdicts.verdict(
        bad, speak("en")
    )
    told = list(sentences.warnings(bad, speak("en")))
    assert any("The model does not fit air humidity: a day ahead it is off by 35 %" in one for one in told)
    (misfit,) = (line for line in bad.summary().splitlines() if "does not fit air_humidity" in line)
    assert misfit.endswith(" %")


def test_yesterdays_readings_are_taken_on_unseen_days_alone(leak: Diagnosis) -> None:
    assert leak.evidence is not None
    record, split = leak.evidence.log.record, leak.evidence.log.split
    air, day = record.measured["air_temperature"], round(86_400 / record.step)
    rows = [row for row in range(day, len(record)) if not split.fit_rows[row]]
    by_hand = np.nanmean([abs(air[row] - air[row - day]) for row in rows])
    assert leak.evidence.log.persistence_errors(["air_temperature"])["air_temperature"] == pytest.approx(by_hand)


def test_a_leak_costs_what_the_outdoor_air_that_comes_in_must_be_heated(leak: Diagnosis) -> None:
    (finding,) = leak.findings
    found = worth(leak, finding)
    assert found is not None
    assert leak.evidence is not None
    record = leak.evidence.log.record
    size, exponent = (finding.parameters[name].value for name in ("air_changes", "exponent"))
    exchange = size * record.inputs["wind_speed"] ** exponent * record.inputs["mean_height"] / 3600.0
    difference = record.measured["air_temperature"] - record.inputs["outdoor_temperature"]
    all_day = 7.0 * 86_400.0 * float(np.nanmean(exchange * 1.2 * 1006.0 * difference)) / 1e6
    # Not all of it is bought: by day the sun heats.
    assert 0.4 * all_day < found.heat < all_day
    assert found.co2 > 0.0
    assert found.money == pytest.approx(0.0083 * found.heat + 0.08 * found.co2)
    half = replace(finding, parameters={"air_changes": Estimate(1.0, 0.5, 1.5, "h-1")})
    assert worth(leak, half).spread == (0.5, 1.5)  # type: ignore[union-attr]


@pytest.mark.usefixtures("without_pictures")
def test_the_document_tells_what_a_finding_takes_from_the_whole_greenhouse(leak: Diagnosis, tmp_path: Path) -> None:
    (finding,) = leak.findings
    found = worth(leak, finding)
    assert found is not None
    write_diagnosis(tmp_path, leak)
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    area = leak.model.site.greenhouse.floor_area
    assert document["findings"][0]["eur_per_week"] == pytest.approx(area * found.money, abs=0.01)


@pytest.mark.usefixtures("without_pictures")
def test_a_greenhouse_without_lamps_is_told_what_a_cause_costs(leak: Diagnosis, tmp_path: Path) -> None:
    (finding,) = leak.findings
    lit, evidence, site = worth(leak, finding), leak.evidence, leak.model.site
    assert lit is not None
    assert evidence is not None
    log = replace(evidence.log, record=replace(evidence.log.record, lamp_efficacy=0.0))
    dark = replace(site, greenhouse=replace(site.greenhouse, lamps=None))
    unlit = replace(leak, evidence=replace(evidence, log=log), model=replace(leak.model, site=dark))
    found = worth(unlit, finding)
    assert found is not None
    assert (found.heat, found.lamp_light) == (lit.heat, 0.0)
    assert found.money == pytest.approx(lit.money, rel=0.1)
    write_diagnosis(tmp_path / "unlit", unlit)
    assert np.isfinite(json.loads((tmp_path / "unlit" / "diagnosis.json").read_text())["findings"][0]["eur_per_week"])


@pytest.mark.parametrize("name", ["co2_valve_leak", "heating_valve_leak", "lamp_heat"])
def test_what_the_corrected_model_does_not_hold_is_not_priced(name: str, leak: Diagnosis) -> None:
    assert worth(leak, replace(leak.findings[0], effect=name)) is None


def test_a_greenhouse_that_is_never_heated_pays_for_no_heat(leak: Diagnosis) -> None:
    """An unheated tunnel was told which heat a cause takes from it, and at what price."""
    (finding,) = leak.findings
    heated, evidence, site = worth(leak, finding), leak.evidence, leak.model.site
    assert heated is not None
    assert evidence is not None
    cold = replace(site, greenhouse=replace(site.greenhouse, heating_capacity=0.0, lamps=None))
    found = worth(replace(leak, model=replace(leak.model, site=cold)), finding)
    assert found is not None
    assert (found.heat, found.co2) == (0.0, heated.co2)
    record = evidence.log.record
    undosed = replace(record, inputs={**record.inputs, "co2_dosing": np.zeros(len(record))})
    tunnel = replace(leak, evidence=replace(evidence, log=replace(evidence.log, record=undosed)))
    assert worth(replace(tunnel, model=replace(leak.model, site=cold)), finding) is None


@pytest.mark.usefixtures("without_pictures")
def test_rivals_are_sentences_and_each_has_its_check(leak: Diagnosis) -> None:
    rivals = ("wind_infiltration", "vent_backlash", "screen_gap")
    page = render_report(replace(leak, findings=(replace(leak.findings[0], confounded=rivals),)))
    for name in rivals[1:]:
        assert f"It may as well be {EFFECTS[name].title}:" in page
    for name in rivals:
        assert f"{EFFECTS[name].separating_test[1:]}." in page
    assert "vent_backlash" not in page


def test_a_sensor_that_reads_too_much_saves_heat_since_the_greenhouse_is_colder(leak: Diagnosis) -> None:
    off = replace(leak.findings[0], effect="air_temperature_offset", kind="sensor")
    saved = Worth(heat=-3.6, co2=0.0, lamp_light=0.0, money=-0.03, spread=(0.5, 1.5))
    assert sentences.costs(off, saved, 100.0, speak("en")) == [
        "It saves 3.6 MJ of heat per m² and week (1 kWh).",
        "That is so since the greenhouse is colder than its sensor shows.",
        "In money, by the prices of the site: 0.03 EUR saved per m² and week, 3 EUR for the greenhouse.",
        "It may be 0.5 to 1.5 times as much (90 % interval).",
    ]
    nothing = Worth(heat=0.0, co2=0.0, lamp_light=0.0, money=0.0, spread=None)
    american = sentences.costs(off, saved, 100.0, speak("en", units="us"))
    assert american[0] == "It saves 320 BTU of heat per ft² and week (0.093 kWh)."
    assert american[2].startswith("In money, by the prices of the site: 0.0028 EUR saved per ft² and week, 3 EUR for")
    assert sentences.costs(off, nothing, 100.0, speak("en"))[0].startswith("It takes no heat and no CO2 worth counting")


@pytest.mark.usefixtures("without_pictures")
def test_an_actuator_that_the_log_lacks_is_told_in_every_language(leak: Diagnosis) -> None:
    share = {"share": Estimate(0.9, 0.8, 1.0, "1")}
    lamps = replace(
        leak.findings[0], effect="lamp_power", kind="actuator", parameters=share, confounded=("lamp_power",)
    )
    assert worth(leak, lamps) is None
    assert sentences.cause(lamps, speak("en")).startswith("The log lacks this: lamp power.")
    assert "lampvermogen" in sentences.cause(lamps, speak("nl"))
    assert sentences.checks(lamps, speak("nl")) == ["Laat dit in het logboek schrijven: lampvermogen."]
    assert "Lamp power" in render_report(replace(leak, findings=(lamps,)))


def test_co2_that_cannot_be_judged_is_said_to_be_so(leak: Diagnosis, undosed: Log) -> None:
    errors = {name: table for name, table in leak.errors.items() if name != "air_co2"}
    said = list(sentences.warnings(replace(leak, log=undosed, errors=errors, missing=("co2_dosing",)), speak("en")))
    assert said == ["CO2 cannot be judged: the log does not tell how much CO2 was dosed."]
    without = replace(leak, log=undosed.without("air_co2"), errors=errors)
    assert list(sentences.warnings(without, speak("en"))) == ["CO2 cannot be judged: the log does not have it."]


def test_times_are_those_of_the_greenhouse(page: str) -> None:
    # The log begins at 2020-02-01 00:00 UTC.
    assert "Log from 1 Feb 2020 01:00" in page
    assert "times of Europe/Amsterdam" in page


def test_the_log_is_shown_with_what_was_set_aside(page: str) -> None:
    assert "air humidity: stuck, 1 ×, 14.8 h in all." in page
    assert 'aria-label="The log; what was set aside is red"' in page
    assert "var(--aside)" in page


def test_a_fault_of_the_data_has_its_page_too(stuck: Diagnosis) -> None:
    page = render_report(stuck, "de")
    assert "Ein Sensor, der gebraucht wird, arbeitet nicht: Lufttemperatur." in page
    assert "does not work" not in page
    assert "were set aside" not in page
    assert page.count("<svg") == 1


def test_what_a_fault_of_the_data_saw_is_told_and_its_mend_can_be_copied() -> None:
    table = greenhouse_log(1, days=8).telemetry
    table = table.with_columns({"air_temperature": table["air_temperature"] * 1.8 + 32.0})
    (fault,) = find_faults(table)
    _, detail = sentences.fault(fault, speak("de"))
    assert re.search(r"Lufttemperatur .*Median von \d\d,\d", detail)
    assert "air_temperature: {column: ..., scale: 0.5555556, offset: -17.77778}" in detail
    assert not re.search(r"\b(has|so it is|in the mapping)\b", detail)


def test_a_note_with_figures_is_told_too(leak: Diagnosis) -> None:
    sentence = OpenVents(-120.0, -110.0).sentence
    (note,) = sentences.notes(replace(leak, notes=(sentence,)), speak("de"))
    assert note.startswith("Bei weit offenen Lüftungen zeigt der CO2-Sensor von den ersten Tagen an 115 ppm unter der")


def test_errors_and_differences_of_an_american_site_are_in_its_degrees(leak: Diagnosis) -> None:
    metric, us = speak("en"), speak("en", units="us")
    errors = with_errors(leak, "air_temperature", deployed=1.0, recalibrated=0.55, corrected=0.5)
    (row,) = [one for one in error_rows(errors, us) if one.quantity == "air temperature"]
    assert ([text for text, _ in row.cells], row.unit) == (["1.8", "0.99", "0.9"], "°F")
    (same,) = [one for one in error_rows(errors, metric) if one.quantity == "air temperature"]
    assert ([text for text, _ in same.cells], same.unit) == (["1", "0.55", "0.5"], "K")
    evidence = leak.evidence
    assert evidence is not None

    def drawn(figure: Figure, panel: int = 0) -> np.ndarray:
        return np.asarray(max(figure.axes[panel].lines, key=lambda one: np.size(one.get_xdata())).get_xydata())

    ours, theirs = (drawn(plots.worst_day(evidence, "air_temperature", one)) for one in (metric, us))
    assert theirs[:, 1] == pytest.approx(ours[:, 1] * 1.8 + 32.0)
    ours, theirs = (drawn(plots.residual_by_date(evidence, one)) for one in (metric, us))
    assert theirs[:, 1] == pytest.approx(ours[:, 1] * 1.8, nan_ok=True)
    ours, theirs = (drawn(plots.residual_against_driver(evidence, "wind_speed", one)) for one in (metric, us))
    assert theirs[:, 0] == pytest.approx(ours[:, 0] * 2.23693629)
    assert theirs[:, 1] == pytest.approx(ours[:, 1] * 1.8, nan_ok=True)
    regimes = {"calm": Estimate(1.0, 0.5, 1.5, "K"), "windy": Estimate(2.0, 1.5, 2.5, "K")}
    ours, theirs = (drawn(plots.coefficient_by_regime(regimes, one, "K")) for one in (metric, us))
    assert theirs[:, 0] == pytest.approx(ours[:, 0] * 1.8)
    log = leak.log
    assert log is not None
    bands = [
        plot_log(log.name, log.telemetry, log.screened, only=("outdoor_temperature",), language=one)
        .axes[0]
        .dataLim.intervaly
        for one in (metric, us)
    ]
    assert bands[1] == pytest.approx(bands[0] * 1.8 + 32.0)


@pytest.mark.usefixtures("without_pictures")
def test_the_size_of_a_cause_goes_with_its_unit(leak: Diagnosis) -> None:
    offset = Estimate(1.0, 0.5, 1.5, "K")
    finding = replace(leak.findings[0], effect="air_temperature_offset", parameters={"offset": offset}, onset=None)
    assert sentences.cause(finding, speak("en", units="us")) == "The temperature sensor reads 1.8 °F too much."
    assert sentences.cause(finding, speak("de")) == "Der Temperatursensor zeigt 1 K zu viel an."
    sun = Estimate(0.5, 0.3, 0.7, "K (100 W m-2)-1")
    name = "air_temperature_radiation_error"
    warmed = replace(finding, effect=name, parameters={EFFECTS[name].amplitude.name: sun})
    assert "it reads 0.9 °F too much for each" in sentences.cause(warmed, speak("en", units="us"))
    stored = replace(finding, effect="soil_heat_storage", confounded=("pipe_lag",))
    assert sentences.checks(stored, speak("en", units="us"))[0].startswith("Hold the heating setpoint 3.6 °F lower")
    assert "18 °F" in sentences.checks(stored, speak("de", units="us"))[1]
    assert "2 K lower" in sentences.checks(stored, speak("en"))[0]
    home = replace(leak, findings=(finding,))
    assert home.log is not None
    american = replace(home, log=replace(home.log, site=replace(home.log.known_site, units="us")))
    assert "<td>1.8</td><td>0.9 to 2.7</td><td>°F</td>" in render_report(american)


@pytest.mark.parametrize("code", LANGUAGES)
@pytest.mark.parametrize("name", EFFECTS)
def test_a_size_whose_unit_is_another_in_america_is_said_with_it(name: str, code: str) -> None:
    """No sentence of a cause has a part in kelvin, metres a second or grams per m2, in any language."""
    effect, metric, us = EFFECTS[name], speak(code), speak(code, units="us")
    unit = effect.amplitude.unit
    for sentence in filter(None, (effect.sentence, effect.opposite)):
        told, here = us.sized(sentence, 2.0, unit), metric.sized(sentence, 2.0, unit)
        assert not re.search(r"[Kk]elvin|开尔文|m/s|g/m|\d K\b|°C|degC", told)
        if unit in US:
            assert us.number(us.shown(unit).of(2.0)) in told
            assert metric.number(2.0) in here


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("wind_infiltration", 0.1, "about 0.045 air changes per hour more for each mph of wind"),
        ("screen_gap", 1.8, "about 1 W/m2 more for each °F of difference to outside"),
        ("soil_respiration", 1.0, "about 0.0033 oz/ft² per hour at 68 °F"),
        ("photosynthesis_heat_limit", 0.2, "0.2 less for 18 °F too much"),
        ("stack_ventilation", 0.1, "(0.17 mph per root °F)"),
    ],
)
def test_a_size_of_several_units_is_told_in_those_of_the_site(name: str, value: float, told: str) -> None:
    effect = EFFECTS[name]
    assert told in speak("en", units="us").sized(effect.sentence, value, effect.amplitude.unit)


def test_figures_share_one_style_and_turn_dark_with_the_page(page: str) -> None:
    drawn = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    assert len(drawn) >= 7
    for one in drawn:
        assert not re.findall(r"(?:fill|stroke): ?#", one)
        assert "DejaVu" not in one
        assert "<image" not in one
    ids = re.findall(r' id="([^"]+)"', "".join(drawn))
    assert not [name for name in ids if re.fullmatch(r"[a-z0-9]+_\d+", name)]


@pytest.mark.parametrize(("code", "sign"), [("en", "."), ("nl", ","), ("de", ","), ("es", ","), ("zh", ".")])
def test_figures_have_the_decimal_sign_of_the_text_beside_them(
    page_in: Callable[[str], str], code: str, sign: str
) -> None:
    numbers = re.findall(r"<text[^>]*>[−-]?\d+([.,])\d+</text>", page_in(code))
    assert set(numbers) == {sign}


@pytest.mark.parametrize("code", LANGUAGES[1:])
def test_a_page_in_another_language_has_no_english_text_of_its_own(page_in: Callable[[str], str], code: str) -> None:
    page = page_in(code)
    assert f'<html lang="{code}">' in page
    words = re.sub(
        r"<style>.*?</style>|<(\w+)[^>]* lang=\"en\">.*?</\1>|<code>.*?</code>|<[^>]+>", " ", page, flags=re.DOTALL
    )
    for english in (" the ", " of ", " with ", " air ", " and ", "greenhouse", "temperature", "February"):
        assert english not in words


def test_numbers_and_units_are_written_as_people_do(page: str) -> None:
    assert speak("de").number(1234.5) == "1.200"
    assert speak("nl").amount(0.0426, "kg m-2") == "0,043 kg/m²"
    assert written("W m-2 K-1") == "W/(m² K)"
    assert written("h-1 (m s-1)-1") == "1/(h (m/s))"
    units = {one.unit for one in QUANTITIES.values()} | {p.unit for one in EFFECTS.values() for p in one.parameters}
    assert not [unit for unit in units if re.search(r"-\d|deg|umol", written(unit))]
    assert "m-2" not in re.sub(r'<\w+ [^>]*lang="en">.*?<', "", page)


def test_an_unknown_language_is_refused_before_anything_is_written(leak: Diagnosis, tmp_path) -> None:
    with pytest.raises(IgrowError, match="one of en, nl, de, es, zh"):
        write_diagnosis(tmp_path / "out", leak, "fr")
    assert not (tmp_path / "out").exists()
