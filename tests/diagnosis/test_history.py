"""The history of a greenhouse on designs of known truth: what is learned, what drifts, what its own windows gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.trainer.diagnosis.design import amplitudes, linear
from igrow.trainer.diagnosis.design.candidates import Pattern
from igrow.trainer.diagnosis.design.design import Design, History
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.diagnosis.search import history, scan
from igrow.trainer.diagnosis.search.change import changed, net_gain, proven_gain
from igrow.trainer.diagnosis.search.estimate import estimate
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.model import FittedModel
from tests.diagnosis.synthetic_design import BALANCES, PLAIN, Truth, make_design
from tests.virtual_log import SITE, virtual_log

RNG_SEED = 3
PATTERN = "heat:cold weather"
BARE = NullGains({}, 8.0)
"""Nothing was learned."""


def with_history(design: Design, deviation: float = 0.3, **own: float) -> Design:
    """The design with a history that expects nothing, give or take a deviation of every amplitude."""
    names = amplitudes.keys(design)
    prior = Gaussian(names, np.zeros(len(names)), deviation**2 * np.eye(len(names)))
    known = History(prior, np.zeros_like(design.values[0]), (PLAIN,) * BALANCES, own, null_gains=BARE)
    _, solved = history.solve_jointly(replace(design, history=known))
    return solved


def in_real_parameters(design: Design) -> Design:
    """The design with parameters of the simulator: two of the walls about one of the crop."""
    names = ("leakage_wind", "respiration", "vent_wind")
    block = replace(design.block("parameter"), labels=names)
    prior = Gaussian(names, np.full(3, 2.0), np.eye(3))
    return replace(design, prior=prior, blocks={**design.blocks, "parameter": block})


def test_everything_is_learned_together_by_penalised_least_squares() -> None:
    truth = Truth({"lamp_heat": 0.4}, {PATTERN: -0.2}, (0.3, 0.0, -0.1))
    design = with_history(make_design(truth, sigma=0.5, seed=1))
    found, design = history.solve_jointly(design)
    columns = [*design.columns("parameter"), *design.columns("effect"), *design.columns("pattern")]
    white = (design.whitening(design.values) * design.fitted).reshape(len(design.values), -1)
    left, right = white[columns], white[0]
    matrix = left @ left.T + np.eye(len(columns)) / 0.09
    np.testing.assert_allclose(found.mean, np.linalg.solve(matrix, -left @ right), rtol=1e-6)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(matrix), rtol=1e-6, atol=1e-12)
    expected = np.array([0.3, 0.0, -0.1, 0.4, 0.0, -0.2])
    assert np.all(np.abs(found.mean - expected) < 4.0 * found.standard_deviation)


def test_what_drifts_is_added_to_what_is_not_known() -> None:
    design = in_real_parameters(make_design(seed=2))
    names = amplitudes.keys(design)[:-1]
    rng = np.random.default_rng(0)
    root = rng.normal(size=(len(names),) * 2)
    known = Discrepancy(
        dict.fromkeys(design.prior.names, 1.0),
        Gaussian(names, np.zeros(len(names)), root @ root.T),
        {},
        3600.0,
        {},
        design.line.record.time[0],
    )
    drift = amplitudes.drift_within(design)
    now = history.drifted(known, design).covariance
    np.testing.assert_allclose(now[:-1, :-1], root @ root.T + np.diag(drift[:-1] ** 2))
    # The pattern is new in this log: its prior is that of before any log.
    assert np.isclose(now[-1, -1], DEFAULT.omission_pattern**2 + DEFAULT.pattern_drift**2)
    walls, crop = 2.0 * DEFAULT.wall_drift, 2.0 * DEFAULT.crop_drift
    typical = EFFECTS["lamp_heat"].amplitude.typical
    np.testing.assert_allclose(drift[:4], [walls, crop, walls, DEFAULT.effect_drift * typical])


def test_a_later_log_may_have_drifted_as_far_as_a_walk_goes() -> None:
    design = in_real_parameters(make_design(seed=2))
    soon, late = (amplitudes.drift_over(design, days) for days in (DEFAULT.later_days, 4.0 * DEFAULT.later_days))
    np.testing.assert_allclose(late, 2.0 * soon)
    np.testing.assert_allclose(amplitudes.drift_over(design, 1.0), soon)
    assert np.all(soon >= amplitudes.drift_within(design))


def test_what_a_calibration_log_hardly_shows_may_be_off_by_as_much_as_it_typically_is() -> None:
    design = in_real_parameters(make_design(seed=2))
    column = design.block("effect").columns[[*design.block("effect").labels].index("lamp_heat")]
    values = design.values.copy()
    errors = np.sqrt(np.mean(values[0] ** 2, axis=(1, 2)))
    size = np.sqrt(np.mean((np.sqrt(np.mean(values[column] ** 2, axis=(1, 2))) / errors) ** 2))
    typical = EFFECTS["lamp_heat"].amplitude.typical
    for part, shows in ((0.9, False), (1.1, True)):
        values[column] *= part * DEFAULT.least_shown / (typical * size)
        unseen = amplitudes.hardly_shown(replace(design, values=values))
        assert ("lamp_heat" not in unseen) == shows
        spread = amplitudes.omission(("lamp_heat", PATTERN), DEFAULT, unseen)
        share = DEFAULT.omission_effect if shows else DEFAULT.unseen_effect
        np.testing.assert_allclose(spread, [share * typical, DEFAULT.omission_pattern])
        values = design.values.copy()


def test_a_calibration_in_winter_says_which_effects_it_hardly_showed(known_model: FittedModel) -> None:
    known = known_model.history
    assert known is not None
    of_midsummer = "structure_shade:azimuth=80:width=12"
    assert of_midsummer in known.unseen
    assert "rain_cooling" not in known.unseen
    left = dict(zip(known.amplitudes.names, known.amplitudes.standard_deviation, strict=True))[of_midsummer]
    usual = EFFECTS["structure_shade"].amplitude.typical
    assert left > 2.0 * DEFAULT.omission_effect * usual, "it is as little known as before the log"


def test_of_an_effect_that_is_new_in_a_later_log_the_calibration_has_said_nothing() -> None:
    design = in_real_parameters(make_design(seed=2))
    names = amplitudes.keys(design)
    known = tuple(name for name in names if name != "lamp_heat")
    before = Discrepancy(
        dict.fromkeys(design.prior.names, 1.0),
        Gaussian(known, np.zeros(len(known)), np.eye(len(known))),
        {},
        3600.0,
        {},
        design.line.record.time[0],
    )
    now, drift = history.drifted(before, design), amplitudes.drift_within(design)
    place = names.index("lamp_heat")
    usual = DEFAULT.unseen_effect * EFFECTS["lamp_heat"].amplitude.typical
    assert now.standard_deviation[place] == pytest.approx(np.hypot(usual, drift[place]))


def test_vents_that_hardly_open_any_more_are_told() -> None:
    record = site_record(virtual_log(3, seed=3, step=900.0), SITE, 900.0)
    opening = history.opening_of(record)
    known = Discrepancy({}, Gaussian((), np.zeros(0), np.zeros((0, 0))), {}, 900.0, {}, record.time[0], 3.0 * opening)
    assert history.vents_hardly_open(known, record, DEFAULT)
    assert history.vents_hardly_open(replace(known, opening=0.06), record, DEFAULT)
    for silent in (replace(known, opening=1.5 * opening), replace(known, opening=np.nan), None):
        assert not history.vents_hardly_open(silent, record, DEFAULT)
    closed = replace(
        record, inputs={**record.inputs, **dict.fromkeys(("vent_lee", "vent_wind"), np.zeros(len(record)))}
    )
    assert not history.vents_hardly_open(replace(known, opening=0.0), closed, DEFAULT)


def test_own_gains_tell_what_comes_and_goes_in_a_log_without_a_change() -> None:
    hidden = {"lamp_heat": 0.4}
    steady = with_history(in_real_parameters(make_design(Truth(hidden, {}), days=56, seed=4)))
    comes = with_history(in_real_parameters(make_design(Truth(hidden, {}, onset=28), days=56, seed=4)))
    assert history.own_gains(steady).get("lamp_heat", 0.0) < 6.0
    assert history.own_gains(comes)["lamp_heat"] > 30.0
    assert history.own_gains(comes).get("rain_cooling", 0.0) < 6.0


def test_own_gains_are_of_parameters_too() -> None:
    steady, other = (make_design(Truth({}, {}, (0.0, share, 0.0)), days=56, seed=4) for share in (0.0, 1.2))
    values = steady.values.copy()
    values[0][:, 28:] = other.values[0][:, 28:]
    calm, comes = (with_history(in_real_parameters(one)) for one in (steady, replace(steady, values=values)))
    assert history.own_gains(calm).get("parameter:respiration", 0.0) < 6.0
    assert history.own_gains(comes)["parameter:respiration"] > 30.0
    assert history.own_gains(comes).get("parameter:vent_wind", 0.0) < 6.0


def test_a_change_beyond_the_history_is_named_and_its_own_gain_is_taken_off() -> None:
    # Far beyond what the history leaves open.
    truth = Truth({"lamp_heat": 0.5}, {})
    judged = changed(with_history(make_design(truth, seed=5), 0.01), 0.0, np.random.default_rng(RNG_SEED))
    assert judged.cause is not None and judged.cause.effect == "lamp_heat"
    assert not judged.patterns
    assert abs(judged.named.amplitudes[0] - 0.5) < 4.0 * judged.named.deviations[0]
    found = judged.cause
    told = estimate(judged, np.random.default_rng(RNG_SEED))
    assert told is not None and told.over_null == pytest.approx(proven_gain(judged.design, found) / BARE.least)
    own = with_history(make_design(truth, seed=5), 0.01, lamp_heat=found.gain - 5.0)
    assert np.isclose(net_gain(own, found), 5.0)
    assert changed(own, 0.0, np.random.default_rng(RNG_SEED)).cause is None


def test_nothing_is_named_where_nothing_has_changed() -> None:
    for seed in range(5):
        design = with_history(make_design(seed=10 + seed), 0.05)
        judged = changed(design, 0.0, np.random.default_rng(RNG_SEED))
        assert judged.cause is None and not judged.patterns


def test_a_pattern_that_fits_better_than_every_name_is_not_named() -> None:
    design = with_history(make_design(Truth({}, {PATTERN: 0.6}), seed=6), 0.01)
    judged = changed(design, 0.0, np.random.default_rng(RNG_SEED))
    assert judged.cause is None
    assert [one.key for one in judged.patterns] == [PATTERN]


@pytest.mark.parametrize(("left", "named"), [(0.25, True), (0.6, False)])
def test_what_hours_leave_beside_a_change_unmakes_its_name_where_it_is_much_of_its_gain(
    left: float, named: bool
) -> None:
    """Of a large change of a slightly other form much is left; of a wrong one as much as it gains."""
    hours = Pattern("heat", "19 to 11 h", ("hour",))
    truth = Truth({"lamp_heat": 0.8}, {hours.key: left})
    design = with_history(make_design(truth, patterns=(hours,), seed=5), 0.01)
    judged = changed(design, 0.0, np.random.default_rng(RNG_SEED))
    assert (judged.cause is not None) == named
    assert [one.key for one in judged.patterns] == ([] if named else [hours.key])


def test_effects_that_are_not_to_be_considered_are_no_candidates() -> None:
    design = with_history(make_design(Truth({"lamp_heat": 0.5}, {}), seed=5), 0.01)
    assert design.history is not None
    hidden = replace(design, history=replace(design.history, without=frozenset({"lamp_heat"})))
    judged = changed(hidden, 0.0, np.random.default_rng(RNG_SEED))
    assert judged.cause is None


def test_a_change_that_comes_and_goes_from_day_to_day_is_not_proven() -> None:
    """It gains much by the noise, and little by the scatter of days."""
    design = make_design(seed=7)
    values = design.values.copy()
    (column,) = design.columns("effect:lamp_heat")
    of_day = np.random.default_rng(8).normal(0.5, 0.8, size=design.split.days)
    values[0] -= of_day[:, None] * values[column]
    fickle = with_history(replace(design, values=values).whitened(design.whitening), 0.01)
    null = linear.fit(fickle.grams, fickle.null_model())
    scored = scan.score_candidates(fickle, null, [None], np.random.default_rng(0))
    (found,) = [one for one in scored if one.effect == "lamp_heat"]
    assert net_gain(fickle, found) > BARE.least > proven_gain(fickle, found)
    assert changed(fickle, 0.0, np.random.default_rng(RNG_SEED)).cause is None
