"""What has no name: told by the pattern that makes days better which no fit has seen, more than chance does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Floats
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import Log
from igrow.trainer.diagnosis import DEFAULT, diagnose
from igrow.trainer.diagnosis.design import candidates, sensitivity
from igrow.trainer.diagnosis.design.candidates import UNIT_FLUX, Pattern
from igrow.trainer.diagnosis.design.freerun import log_days
from igrow.trainer.diagnosis.knowledge import knowledge_of
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.search import unexplained
from igrow.trainer.diagnosis.search.rounds import Search, search_of
from igrow.trainer.diagnosis.validation.correction import correct, with_unexplained
from igrow.trainer.fit import FittedModel
from tests.diagnosis.known_greenhouse import DAYS, STEP, later, weeks
from tests.virtual_log import SITE

UNHEARD = replace(DEFAULT, least_pattern_change=1e6)
"""Steps are asked for more than any log can give, as if what hides were small."""
HOURS = np.arange(DAYS * 96) * STEP / 3600.0
WEEKDAY = (5 + np.floor(HOURS / 24.0)) % 7
"""The log begins on a Saturday."""


def search(log: Log, model: FittedModel) -> Search:
    known = knowledge_of(model, SITE, DEFAULT)
    return search_of(log_days(log, model), SITE, known, frozenset(), DEFAULT)


def within(first: float, last: float) -> Floats:
    inside: Floats = ((first <= HOURS % 24.0) & (last > HOURS % 24.0)).astype(np.float64)
    return inside


def with_a_door(before: Telemetry) -> Log:
    """A log in which a door stands open at work, as it did not in the weeks before."""
    opened = within(7.0, 16.0) * (WEEKDAY < 5)
    return later(before, weeks(added={"air_exchange": 0.003 * opened}))


@pytest.mark.slow
def test_a_door_that_steps_do_not_tell_unseen_days_tell(known_weeks: Telemetry, known_model: FittedModel) -> None:
    told = diagnose(with_a_door(known_weeks), known_model, rules=UNHEARD)
    assert told.verdict == "unexplained"
    (found,) = told.findings
    assert "hour" in found.drivers
    assert found.p_value < 0.05
    (size,) = found.parameters.values()
    assert size.low > 0.0


@pytest.mark.slow
def test_a_floor_that_is_hosed_on_thursdays_evaporates(
    known_weeks: Telemetry, known_model: FittedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Vapour that comes and heat that goes are one thing. Three Thursdays take less off twenty days than is asked."""
    hosed = 1e-5 * within(6.0, 10.0) * (WEEKDAY == 3)
    seen = later(known_weeks, weeks(added={"vapour": hosed, "heat": -LATENT_HEAT * hosed}))
    monkeypatch.setattr(unexplained, "read_null_pattern_skills", lambda: NullGains({}, 0.02))
    (found,) = search(seen, known_model).unexplained(np.random.default_rng(0))
    assert isinstance(found.cause, Pattern)
    assert (found.cause.channel, found.cause.when) == ("evaporation", "06 to 10 h on Thursdays")
    # Much of it condenses again.
    assert 0.3e-5 < found.amplitude * UNIT_FLUX["evaporation"] < 1.5e-5
    told = diagnose(seen, known_model, rules=UNHEARD)
    assert "06 to 10 h on Thursdays" in told.findings[-1].sentence


def test_nothing_is_unexplained_where_nothing_is_missing(known_weeks: Telemetry, known_model: FittedModel) -> None:
    assert search(later(known_weeks, known_weeks), known_model).unexplained(np.random.default_rng(0)) == ()


def test_evaporation_is_vapour_and_the_heat_that_it_takes(known_weeks: Telemetry, known_model: FittedModel) -> None:
    design = search(later(known_weeks, known_weeks), known_model).design(())
    finer, columns = candidates.finer_columns(design.line, SITE.longitude)
    assert {one.channel for one in finer if not one.is_weekly} == {"evaporation"}
    (place,) = (row for row, one in enumerate(finer) if one.key == "evaporation:07 to 16 h")
    course = {when: course for when, _, course in candidates.patterns(design.line.record, SITE.longitude)}["07 to 16 h"]
    flux = UNIT_FLUX["evaporation"] * course
    (run,) = sensitivity.flux_sensitivities(design.line, [({"vapour": flux, "heat": -LATENT_HEAT * flux}, 0.1)])
    assert np.array_equal(columns[place], run, equal_nan=True)
    added = candidates.pattern_fluxes(design.line.record, SITE.longitude, {finer[place]: 2.0})
    assert np.allclose(added["vapour"], 2.0 * flux)
    assert np.allclose(added["heat"], -2.0 * LATENT_HEAT * flux)


@pytest.mark.slow
def test_what_acts_on_one_day_of_the_week_has_a_bound_of_its_own(
    known_weeks: Telemetry, known_model: FittedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = search(with_a_door(known_weeks), known_model)
    monkeypatch.setattr(unexplained, "read_null_pattern_skills", lambda: NullGains({"weekly": 0.9}, 0.02))
    best, *others_of_a_kind = change.unexplained(np.random.default_rng(0))
    assert isinstance(best.cause, Pattern)
    assert (best.cause.channel, best.cause.kind) == ("air_exchange", "air_exchange")
    kinds = [one.cause.kind for one in others_of_a_kind if isinstance(one.cause, Pattern)]
    assert kinds
    assert len({*kinds, "air_exchange", "weekly"}) == len(kinds) + 2
    others = dict.fromkeys(candidates.CHANNELS, 0.9)
    monkeypatch.setattr(unexplained, "read_null_pattern_skills", lambda: NullGains(others, 0.0))
    (found,) = change.unexplained(np.random.default_rng(0))
    assert isinstance(found.cause, Pattern)
    assert found.cause.kind == "weekly"
    assert not found.cause.when.endswith(("Saturdays", "Sundays"))


@pytest.mark.slow
def test_of_several_patterns_that_is_told_which_free_runs_bear_out(
    known_weeks: Telemetry, known_model: FittedModel
) -> None:
    """Its opposite makes them worse; told alone it is nothing."""
    change = search(with_a_door(known_weeks), known_model)
    patterns = change.unexplained(np.random.default_rng(0))
    opposite = tuple(replace(one, amplitude=-one.amplitude) for one in patterns)
    days, known = change.days, change.knowledge
    plain = correct(days, known, (), (), SITE.longitude, DEFAULT)
    assert with_unexplained(days, known, plain, opposite, SITE.longitude, DEFAULT) == (plain, ())
    result, (told,) = with_unexplained(days, known, plain, (*opposite, *patterns), SITE.longitude, DEFAULT)
    assert told in patterns
    assert isinstance(told.cause, Pattern)
    assert told.cause.channel == "air_exchange"
    assert set(result.stages["corrected"].patterns) == {told.cause}


@pytest.mark.slow
def test_what_gained_as_much_in_the_calibrations_own_weeks_is_no_news(
    known_weeks: Telemetry, known_model: FittedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    change = search(with_a_door(known_weeks), known_model)
    always = dict.fromkeys((one.key for one in change.design(()).patterns), 1e6)
    used_to_it = replace(change, history=replace(change.history, own_gains=always))
    # What is no pattern of a calibration is not asked here.
    finer = {"weekly": 0.9, "evaporation": 0.9}
    monkeypatch.setattr(unexplained, "read_null_pattern_skills", lambda: NullGains(finer, 0.0))
    assert change.unexplained(np.random.default_rng(0))
    assert used_to_it.unexplained(np.random.default_rng(0)) == ()
