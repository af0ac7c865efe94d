"""What a finding says to the grower."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.bundle import Estimate
from igrow.core.effects import EFFECTS
from igrow.core.language import speak
from igrow.core.site import Site
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.answer.result import plain
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search.estimate import Estimated, OnsetInterval
from igrow.trainer.diagnosis.search.scan import Hypothesis
from igrow.trainer.report import sentences

BEGAN = np.datetime64("2020-03-14T06:00:00", "s")


def leak(confounded: tuple[str, ...] = ("wind_infiltration",)) -> Estimated:
    cause = Hypothesis(Candidate("wind_infiltration", ()), Term(0), 40.0, 0.118, 5.0, 0.001)
    shapes = {"exponent": Estimate(1.1, 0.9, 1.3, "1")}
    size = Estimate(0.118, 0.08, 0.15, "h-1 (m s-1)-1")
    term = ActiveTerm("wind_infiltration", 0.118, {"exponent": 1.1})
    return Estimated(cause, term, size, 40.0, None, confounded, shapes=shapes)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.11777, "0.12"), (12.4, "12"), (0.0, "0"), (3.0, "3"), (-0.00051, "-0.00051"), (1234.0, "1200")],
)
def test_numbers_have_two_significant_digits(value: float, text: str) -> None:
    assert plain(value) == text


def test_the_sentence_names_the_size_and_the_day_on_which_it_began() -> None:
    always = wording.sentence(leak())
    assert always.startswith("More air leaks in when the wind blows")
    assert "0.12" in always
    assert always.endswith(".")
    late = wording.sentence(replace(leak(), onset=OnsetInterval(BEGAN, BEGAN, BEGAN)))
    assert late.startswith("Since 14 March more air leaks in")
    # East of Greenwich a day begins before midnight in UTC, west of it after.
    for began in ("2020-03-13T23:42:00", "2020-03-14T05:00:00"):
        time = np.datetime64(began, "s")
        assert "Since 14 March" in wording.sentence(replace(leak(), onset=OnsetInterval(time, time, time)))


@pytest.mark.parametrize(
    ("zone", "began"),
    [("UTC", "2020-03-13T23:42:00"), ("Asia/Tokyo", "2020-03-13T14:41:00"), ("America/Toronto", "2020-03-14T05:45:00")],
)
def test_the_report_tells_the_day_of_the_sentence(zone: str, began: str) -> None:
    time = np.datetime64(began, "s")
    found = wording.finding(replace(leak(), onset=OnsetInterval(time, time, time)))
    assert found.sentence.startswith("Since 14 March ")
    assert sentences.cause(found, speak("en", zone)).startswith("Since 14 March 2020:")


def test_a_finding_holds_size_shapes_balances_and_test_of_its_effect() -> None:
    found = wording.finding(leak())
    assert (found.effect, found.kind, found.balances) == ("wind_infiltration", "process", ("heat", "vapour", "co2"))
    assert set(found.parameters) == {"air_changes", "exponent"}
    assert found.separating_test == EFFECTS["wind_infiltration"].separating_test


def test_confounded_causes_get_the_tests_that_separate_them_each_once() -> None:
    names = ("co2_valve_leak", "soil_respiration", "co2_offset", "co2_drift")
    text = wording.separating_test(names)
    told = text.split("; or ")
    assert told == list(dict.fromkeys(EFFECTS[name].separating_test for name in names[:3]))


def test_a_discrepancy_is_told_by_its_hours_weather_and_channels() -> None:
    cold = Hypothesis(Pattern("heat", "cold weather", ("outdoor_temperature",)), Term(1), 50.0, 0.5, 10.0, 0.001)
    door = Hypothesis(Pattern("air_exchange", "07 to 16 h", ("hour", "weekday")), Term(2), 50.0, -2.0, 4.0, 0.003)
    found = wording.discrepancy([cold, door], DEFAULT)
    assert (found.effect, found.kind, found.confounded) == ("discrepancy", "discrepancy", ("discrepancy",))
    assert found.sentence == (
        "Something that the model does not know changes heat (more, cold weather); air exchange (less, 07 to 16 h)."
    )
    assert found.balances == ("heat", "vapour", "co2")
    assert found.drivers == ("outdoor_temperature", "hour", "weekday")
    size = found.parameters["heat: cold weather"]
    # Half of 10 W m-2, its standard error a tenth of it.
    assert (size.value, size.unit) == (5.0, "W m-2")
    assert size.high == pytest.approx(5.0 * (1.0 + 1.6449 / 10.0), rel=1e-4)
    assert found.p_value == 0.001


def test_in_thin_air_it_is_said_which_amounts_are_told_too_large() -> None:
    """Air of 3000 m weighs seven tenths of that at the sea, with which the simulator counts."""
    assert wording.thin_air(Site(name="quito", latitude=0.5, longitude=-78.2, elevation=3000.0)) == (wording.THIN_AIR,)
    assert "43 % at 3000 m" in wording.THIN_AIR
    assert wording.thin_air(Site(name="madrid", latitude=40.4, longitude=-3.7, elevation=650.0)) == ()
