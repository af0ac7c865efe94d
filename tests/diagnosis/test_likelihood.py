from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import (
    gram,
    likelihood,
    linearisation,
    problem,
    search,
    selection,
    structure,
    usual,
)
from igrow.trainer.diagnosis.gram import RESIDUAL, DailyGrams, Term
from igrow.trainer.diagnosis.linearisation import DivergenceError
from igrow.trainer.diagnosis.problem import Problem
from tests.diagnosis.conftest import deployed_model
from tests.virtual_log import SITE


@pytest.fixture(scope="module")
def quiet(quiet_log: Telemetry) -> Problem:
    deployed = deployed_model()
    record = prepare_log(quiet_log, SITE).record()
    split = split_days(record, SITE.longitude)
    return problem.prepare(record, split, deployed.prior, {}, SITE.longitude, {})


def hiding(quiet: Problem, effect: str, typical: float) -> tuple[Problem, Term, float]:
    """Return the problem with so many typical amplitudes of an effect in its errors, its noise fitted to these."""
    column = next(
        column
        for column, candidate in zip(quiet.candidate, quiet.candidates, strict=True)
        if candidate.effect == effect
    )
    amplitude = typical * EFFECTS[effect].amplitude.typical
    columns = quiet.columns.copy()
    columns[RESIDUAL] -= amplitude * columns[column]
    noise = problem.fit_noise(columns[RESIDUAL], quiet.observed, quiet.fitted)
    products = gram.daily_products(noise(columns), quiet.line.runs.day, quiet.split.days)
    hidden = replace(quiet, columns=columns, whitening=noise, grams=DailyGrams(products, quiet.split.fit))
    return hidden, Term(column), amplitude


def test_a_large_cause_gains_more_beside_its_own_noise_than_beside_the_noise_it_stands_in(quiet: Problem) -> None:
    hidden, term, amplitude = hiding(quiet, "irrigation_evaporation", 4.0)
    null = structure.null_model(hidden)
    none = likelihood.profile(hidden, null)
    own = likelihood.profile(hidden, null.with_term(term), none.whitening)
    scanned = search.fit(hidden.grams, null.with_term(term))
    before = scanned.solution.gain - search.fit(hidden.grams, null).solution.gain
    assert likelihood.gain(hidden, own, none) > 1.5 * before
    assert abs(own.amplitudes[-1] / amplitude - 1.0) < abs(scanned.amplitudes[-1] / amplitude - 1.0)


def test_a_cause_that_is_there_makes_unseen_days_likelier(quiet: Problem) -> None:
    hidden, term, _ = hiding(quiet, "air_temperature_offset", 3.0)
    null = structure.null_model(hidden)
    none = likelihood.profile(hidden, null)
    own = likelihood.profile(hidden, null.with_term(term), none.whitening)
    assert likelihood.doubt(hidden, own, none, np.random.default_rng(0)) < 0.05


def test_what_is_not_there_gains_no_more_than_chance(quiet: Problem) -> None:
    null = structure.null_model(quiet)
    none = likelihood.profile(quiet, null)
    (column, _) = next(iter(zip(quiet.candidate, quiet.candidates, strict=True)))
    own = likelihood.profile(quiet, null.with_term(Term(column)), none.whitening)
    assert -0.5 < likelihood.gain(quiet, own, none) < 8.0


def test_a_term_that_begins_late_leaves_the_days_before_alone(quiet: Problem) -> None:
    hidden, term, _ = hiding(quiet, "air_temperature_offset", 3.0)
    null = structure.null_model(hidden)
    none = likelihood.profile(hidden, null)
    always = likelihood.profile(hidden, null.with_term(term), none.whitening)
    late = likelihood.profile(hidden, null.with_term(replace(term, onset=hidden.split.days // 2)), none.whitening)
    assert likelihood.gain(hidden, always, none) > likelihood.gain(hidden, late, none) > 0.0


def test_what_logs_usually_show_is_no_evidence(quiet: Problem) -> None:
    hidden, term, amplitude = hiding(quiet, "air_temperature_offset", 3.0)
    none = likelihood.profile(hidden, structure.null_model(hidden))
    fit = search.fit(hidden.grams, none.model)
    ranked = selection.score_candidates(hidden, fit, [None], np.random.default_rng(0))
    own = [one for one in ranked if one.term == term]
    assert own
    for size, share in ((0.0, 1.0), (10.0 * amplitude, 0.1)):
        seen = replace(hidden, usual_size={"air_temperature_offset": size})
        (contender,) = selection.contest(seen, none, own, np.random.default_rng(0))
        assert contender.evidence <= share * contender.hypothesis.gain
        assert contender.evidence > 0.0


def test_the_usual_amplitude_is_the_root_mean_square_over_logs_that_show_it_and_those_that_do_not() -> None:
    logs = [{"lamp_heat": 0.04}, {"lamp_heat": 0.0, "rain_cooling": 4.0}, {}, {"lamp_heat": 0.04}]
    assert usual.root_mean_squares(logs) == {"lamp_heat": pytest.approx(0.1414, abs=1e-3), "rain_cooling": 1.0}


def test_only_a_log_of_a_season_is_asked_for_more_than_seasons_usually_show() -> None:
    known = usual.installed()
    assert known.sizes(29) == {}
    assert set(known.sizes(85)) <= set(EFFECTS)
    assert known.sizes(85)["structure_shade"] > 0.0


def test_a_model_that_runs_out_of_all_bounds_says_so(quiet: Problem) -> None:
    line = quiet.line
    absurd = {"lamp_heat": {"share": 1e300}}
    with pytest.raises(DivergenceError, match="lamp_heat runs out of all bounds"):
        linearisation.linearise(line.record, line.runs, line.parameters, absurd)
