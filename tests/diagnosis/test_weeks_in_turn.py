"""A long log is asked part by part; what a part tells the next ones are asked again, and silence teaches them too."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import DEFAULT, Diagnosis, Finding, diagnose
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.answer.answers import Answer
from igrow.trainer.diagnosis.design import amplitudes, linear
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.diagnosed_days import weeks_in_turn, well_read
from igrow.trainer.diagnosis.knowledge import PARAMETER_PREFIX, knowledge_of
from igrow.trainer.diagnosis.search import history
from igrow.trainer.diagnosis.search.rounds import search_of
from igrow.trainer.fit import FittedModel
from tests.diagnosis.known_greenhouse import KNOWN, later
from tests.virtual_log import SITE

IN_PARTS = replace(DEFAULT, long_days=11.5)
"""Two parts of the twenty days after the calibration."""
AIR = ("air_temperature", "air_humidity", "air_co2")
module = sys.modules[diagnose.__module__]


def warm(telemetry: Telemetry, kelvin: float) -> Telemetry:
    """Return a log whose air sensor reads too much."""
    return telemetry.with_columns({"air_temperature": telemetry["air_temperature"] + kelvin})


@pytest.mark.slow
def test_what_the_oldest_part_tells_is_told_of_the_newest(known_weeks: Telemetry, known_model: FittedModel) -> None:
    told = diagnose(later(known_weeks, warm(known_weeks, 1.2)), known_model, rules=IN_PARTS)
    (finding,) = told.findings
    assert (finding.effect, finding.onset) == ("air_temperature_offset", None)
    assert finding.parameters["offset"].value == pytest.approx(1.2, abs=0.15)
    assert wording.IN_TURN in told.notes
    assert told.start >= known_weeks.time[0] + np.timedelta64(KNOWN + 9, "D")
    # The errors before and after are those of the model in force, and what is shipped has its history.
    assert told.model is known_model
    assert told.corrected.history is known_model.history
    day = told.errors["air_temperature"]["24_h"]
    assert day["corrected"] < 0.8 * day["deployed"]


@pytest.mark.slow
def test_what_is_no_longer_so_is_told_of_the_part_that_told_it(
    known_weeks: Telemetry, known_model: FittedModel
) -> None:
    seen = later(warm(known_weeks, 1.2), known_weeks, begins=10)
    told = diagnose(seen, known_model, rules=IN_PARTS)
    (finding,) = told.findings
    assert finding.effect == "air_temperature_offset"
    assert wording.EARLIER in told.notes
    assert told.end <= known_weeks.time[0] + np.timedelta64(KNOWN + 10, "D")


def test_weeks_in_which_nothing_is_told_teach_what_to_expect(known_weeks: Telemetry, known_model: FittedModel) -> None:
    """The mean moves to where the log put it, and is known more surely; what the log says nothing of stays."""
    assert known_model.history is not None
    known = knowledge_of(known_model, SITE, DEFAULT)
    log = later(known_weeks, known_weeks)
    search = search_of(log_days(log, known_model), SITE, known, frozenset(), DEFAULT)
    seen = search.history_after(())
    assert seen is not None
    before, now = known_model.history.amplitudes, seen.amplitudes
    assert set(before.names) <= set(now.names)
    design = search.design(())
    solution = linear.fit(design.grams, design.null_model()).solution
    name = PARAMETER_PREFIX + "transmissivity"
    moved = now.values[name] - before.values[name]
    assert moved == pytest.approx(dict(zip(amplitudes.keys(design), solution.coefficients, strict=True))[name])
    expected = history.drifted(known_model.history, search.plain)
    assert now.deviations[name] < expected.deviations[name]
    assert seen.middle > known_model.history.middle
    # By what it was taught the same log has less that is new.
    again = history.expected(seen, search.plain, history.expected_misfit(seen, search.plain))
    assert np.sum(again.values[0] ** 2) < np.sum(design.values[0] ** 2)


@pytest.mark.parametrize(
    ("parts", "told", "note"),
    [
        (["", "", ""], "", wording.IN_TURN),
        (["co2_offset", "co2_offset", "co2_offset"], "co2_offset", wording.IN_TURN),
        (["", "co2_offset", ""], "co2_offset", wording.EARLIER),
        (["co2_offset", "lamp_heat", "lamp_heat"], "co2_offset", wording.EARLIER),
        (["discrepancy", "", ""], "discrepancy", wording.EARLIER),
        (["discrepancy", "", "lamp_heat"], "lamp_heat", wording.IN_TURN),
    ],
)
def test_which_part_is_told(
    parts: list[str],
    told: str,
    note: str,
    known_model: FittedModel,
    known_weeks: Telemetry,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nothing = diagnosis_of("", later(known_weeks, known_weeks), known_model)
    asked = iter(parts)

    def answer(_question: object, log: Log, *_: object, **__: object) -> object:
        return Answer(replace(diagnosis_of(next(asked), log, known_model), notes=nothing.notes))

    monkeypatch.setattr(module._Question, "answer", answer)
    monkeypatch.setattr(module, "weeks_in_turn", lambda log, *_: [log, log, log])
    found = diagnose(
        prepare_log(known_weeks.select(end=known_weeks.time[0] + np.timedelta64(20, "D")), SITE), known_model
    )
    assert [one.effect for one in found.findings] == [told] * bool(told)
    assert found.notes[-1] == note


def test_weeks_in_which_the_air_was_not_read_are_left_out(known_weeks: Telemetry) -> None:
    def unread(begin: int, end: int | None) -> Telemetry:
        since = (known_weeks.time - known_weeks.time[0]) / np.timedelta64(1, "D")
        dead = (since >= begin) & (since < (np.inf if end is None else end))
        return known_weeks.with_columns({"air_temperature": np.where(dead, np.nan, known_weeks["air_temperature"])})

    def parts(telemetry: Telemetry) -> list[Log]:
        return weeks_in_turn(prepare_log(telemetry, SITE), replace(DEFAULT, long_days=16.0))

    every = parts(known_weeks)
    assert well_read(every) == (every, ())
    for begin, end, left in ((14, 30, [0, 2]), (8, None, [0]), (0, 18, [1, 2])):
        own = parts(unread(begin, end))
        read, notes = well_read(own)
        assert [one.telemetry.time[0] for one in read] == [every[one].telemetry.time[0] for one in left]
        assert notes == (wording.UNREAD,)
    with pytest.raises(IgrowError, match=r"air_temperature has readings in half of the hours on 0 days.*needs 5"):
        well_read(parts(unread(3, None))[1:])


@pytest.mark.slow
def test_a_sensor_that_died_is_no_end_of_a_diagnosis(known_weeks: Telemetry, known_model: FittedModel) -> None:
    """Of a long log a whole part may be without readings."""
    dead = known_weeks.with_columns({name: np.full(len(known_weeks), np.nan) for name in AIR})
    told = diagnose(later(known_weeks, dead, begins=10), known_model, rules=IN_PARTS)
    assert wording.UNREAD in told.notes
    assert told.end <= known_weeks.time[0] + np.timedelta64(KNOWN + 10, "D")


def diagnosis_of(effect: str, log: Log, model: FittedModel) -> Diagnosis:
    """Return a diagnosis that tells an effect, or nothing."""
    finding = Finding(
        effect, "discrepancy" if effect == "discrepancy" else "process", (), {}, None, 0.0, (effect,), (), ""
    )
    time = log.telemetry.time
    findings = (finding,) if effect else ()
    return Diagnosis(SITE.name, "nothing", time[0], time[-1], 10, 4, findings, {}, (), model, model, log=log)
