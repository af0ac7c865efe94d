"""The actuation stage fitted to a log that known rules made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.forecasts.forecaster import fit_forecaster
from benchmarks.forecasts.totals import daily_totals
from igrow.core.arrays import Array
from igrow.core.greenhouse import GreenhouseParameters, generate_weather, recipe, simulate
from igrow.core.greenhouse.climate_computer import ClimateComputer
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator import actuation
from igrow.core.simulator.hybrid.nominal import nominal, site_record
from igrow.core.telemetry import Telemetry, concatenate
from igrow.trainer.data import prepare_log
from igrow.trainer.fit.actuation import by_its_own_rules, fit_actuation, setpoint_columns, unanswered
from igrow.trainer.fit.climate import site_prior
from tests.virtual_log import SITE, virtual_log


def test_rules_fitted_to_a_log_do_what_its_computer_did() -> None:
    log = virtual_log(10, seed=8)
    record = site_record(log, SITE, 300.0)
    setpoints, inferred = setpoint_columns(log, record, SITE)
    assert inferred == ()
    rules = fit_actuation([(record, setpoints, None)], nominal(SITE))
    usual = actuation.default_rules()
    seen = {**record.inputs, **record.measured, "par": np.zeros(len(record))}
    for name, size in (("vent_lee", 3.0), ("rail_pipe_temperature", 4.0), ("energy_screen", 10.0)):
        wanted = actuation.targets(np, setpoints, seen, seen, seen, usual)[name]
        got = actuation.targets(np, setpoints, seen, seen, seen, rules)[name]
        assert np.abs(got - wanted).mean() < size, name
    assert rules["lamp_capacity"] == usual["lamp_capacity"]


def test_what_a_separating_test_asked_of_the_vents_is_no_rule_of_the_plc() -> None:
    log = virtual_log(10, seed=8)
    record = site_record(log, SITE, 300.0)
    setpoints, _ = setpoint_columns(log, record, SITE)
    wanted = fit_actuation([(record, setpoints, None)], nominal(SITE))
    night = log["global_radiation"] <= 0.0
    tested = log.with_columns({"vent_lee": np.where(night, 60.0, log["vent_lee"])})
    disturbed = site_record(tested, SITE, 300.0)
    astray = fit_actuation([(disturbed, setpoints, None)], nominal(SITE))
    rows = by_its_own_rules(tested.with_columns({"separating_test": night.astype(np.float64)}), disturbed)
    assert (~rows).sum() == night.sum()
    found = fit_actuation([(disturbed, setpoints, rows)], nominal(SITE))

    def off(rules: Mapping[str, float]) -> float:
        seen: dict[str, Array] = {**record.inputs, **record.measured, "par": np.zeros(len(record))}
        one, two = (actuation.targets(np, setpoints, seen, seen, seen, each)["vent_lee"] for each in (rules, wanted))
        return float(np.abs(one - two)[~night].mean())

    assert off(found) < 0.3 * off(astray)


@pytest.mark.parametrize(("limit", "found"), [(150.0, (130.0, 170.0)), (1500.0, (1500.0, 1500.0))])
def test_the_radiation_above_which_lamps_stay_dark_is_read_off_the_log(
    limit: float, found: tuple[float, float]
) -> None:
    log = virtual_log(10, seed=8)
    asked = np.ones(len(log))
    power = np.where(log["global_radiation"] < limit, 80.0, 0.0)
    assert limit > 1000.0 or (power == 0.0).sum() > 50
    lit = log.with_columns({"lamp_on": asked, "lamp_power": power})
    record = site_record(lit, SITE, 300.0)
    rules = fit_actuation([(record, setpoint_columns(lit, record, SITE)[0], None)], nominal(SITE))
    assert rules["lamp_capacity"] == 80.0
    assert found[0] <= rules["lamp_radiation"] <= found[1]


def test_a_log_without_setpoints_has_them_inferred_and_says_which() -> None:
    log = virtual_log(4, seed=9)
    bare = log.only([name for name in log.columns if name not in {"heating_setpoint", "co2_setpoint"}])
    record = site_record(bare, SITE, 300.0)
    setpoints, inferred = setpoint_columns(bare, record, SITE)
    assert inferred == ("heating_setpoint", "co2_setpoint")
    assert np.isfinite(setpoints["heating_setpoint"]).all()


@pytest.mark.soak
def test_daily_totals_of_heat_and_co2_follow_from_setpoints() -> None:
    log = virtual_log(14, seed=10)
    record = site_record(log, SITE, 300.0)
    setpoints, _ = setpoint_columns(log, record, SITE)
    day = np.arange(len(record)) // 288
    model = fit_forecaster([(record, setpoints, day < 8, (day >= 8) & (day < 10))], site_prior(SITE), {})
    totals = daily_totals(record, setpoints, model, day >= 10)
    for name in ("heat (MJ m-2)", "lamp electricity (kWh m-2)", "CO2 (kg m-2)"):
        predicted, measured = totals[name]
        assert abs(predicted.sum() / measured.sum() - 1.0) < 0.15, name


def test_a_gap_that_is_longer_than_the_log_hides_no_setpoints() -> None:
    table = virtual_log(8, seed=1)
    late = Telemetry(table.time + np.timedelta64(20, "D"), table.columns)
    log = prepare_log(concatenate([table, late]), SITE)
    setpoints, inferred = setpoint_columns(log.telemetry, log.record(), SITE)
    assert inferred == ()
    assert np.isin(setpoints["heating_setpoint"][:600], (17.0, 20.0)).mean() > 0.9


ALL_SITE = replace(SITE, setpoints=SETPOINTS)
BETWEEN = {
    "humidity_setpoint": (70.0, 90.0),
    "ventilation_setpoint": (18.0, 26.0),
    "minimum_pipe_setpoint": (0.0, 55.0),
    "energy_screen_setpoint": (0.0, 100.0),
}


@pytest.fixture(scope="module")
def moved() -> Telemetry:
    """The log of a mechanistic greenhouse whose further setpoints are moved every six hours, each by itself."""
    start, end = np.datetime64("2020-03-15T00:00:00"), np.datetime64("2020-03-29T00:00:00")
    random = np.random.default_rng(4)
    levels = {name: random.uniform(*ends, 57) for name, ends in BETWEEN.items()}

    def schedule(time: np.datetime64) -> dict[str, float]:
        now = int((time - start) / np.timedelta64(6, "h"))
        return {**recipe(time), **{name: float(values[now]) for name, values in levels.items()}}

    weather = generate_weather(start, end, seed=3)
    return simulate(GreenhouseParameters(), weather, schedule, start, end, seed=2).measured


@pytest.mark.slow
def test_how_a_computer_answers_to_further_setpoints_is_read_off_the_plants_log(moved: Telemetry) -> None:
    record = site_record(moved, ALL_SITE, 300.0)
    setpoints, inferred = setpoint_columns(moved, record, ALL_SITE)
    assert (set(setpoints), inferred) == (set(SETPOINTS), ())
    rules, computer = fit_actuation([(record, setpoints, None)], nominal(ALL_SITE)), ClimateComputer()
    assert rules["lee_humidity"] == 0.0
    assert rules["lee_humidity_opening"] == pytest.approx(computer.humidity_opening, abs=0.04)
    assert rules["lee_humidity_band"] == pytest.approx(computer.humidity_band, abs=2.5)
    assert unanswered(ALL_SITE, rules) == ()
    # The windward vents open for heat alone.
    assert rules["windward_humidity_opening"] == 0.0
    answers = ("lee_ventilation", "rail_minimum", "energy_screen_limited")
    assert [rules[name] for name in answers] == [1.0, 1.0, 1.0]
    asked = {name.removeprefix("setpoint:"): values for name, values in setpoints.items()}
    inputs = {"par": np.zeros(len(record)), **record.inputs, **record.measured}
    aims = actuation.targets(np, asked, inputs, inputs, inputs, rules)
    for name, least in (("vent_lee", 5.0), ("energy_screen", 8.0)):
        away = np.abs(aims[name] - record.inputs[name])
        assert np.nanmean(away) < least, name
    assert actuation.setpoints_of(rules) == SETPOINTS


def test_a_setpoint_that_moves_and_that_nothing_follows_is_not_answered_to(moved: Telemetry) -> None:
    """The columns of another greenhouse's setpoints, beside what this one did without."""
    log = virtual_log(8, seed=1)
    later = {name: moved[name][: len(log)] for name in BETWEEN}
    log = log.with_columns({name: np.resize(values, len(log)) for name, values in later.items()})
    record = site_record(log, ALL_SITE, 300.0)
    setpoints, _ = setpoint_columns(log, record, ALL_SITE)
    rules = fit_actuation([(record, setpoints, None)], nominal(ALL_SITE))
    assert set(actuation.setpoints_of(rules)) <= {*USUAL_SETPOINTS, "humidity_setpoint"}


def test_a_site_that_does_not_name_further_setpoints_is_fitted_as_if_its_log_had_none(moved: Telemetry) -> None:
    fitted = []
    for log in (moved, moved.only(name for name in moved.columns if name not in BETWEEN)):
        record = site_record(log, SITE, 300.0)
        setpoints, inferred = setpoint_columns(log, record, SITE)
        assert (set(setpoints), inferred) == (set(USUAL_SETPOINTS), ())
        fitted.append(fit_actuation([(record, setpoints, None)], nominal(SITE)))
    assert fitted[0] == fitted[1]
    assert actuation.setpoints_of(fitted[0]) == USUAL_SETPOINTS
    assert fitted[0]["lee_humidity"] > 0.0


def test_a_log_without_the_further_setpoints_that_a_site_names_has_none_inferred() -> None:
    log = virtual_log(8, seed=1)
    record = site_record(log, ALL_SITE, 300.0)
    setpoints, inferred = setpoint_columns(log, record, ALL_SITE)
    assert (set(setpoints), inferred) == (set(USUAL_SETPOINTS), ())
    notes = unanswered(ALL_SITE, actuation.default_rules())
    assert notes[0] == "in this log nothing answers to humidity_setpoint: plans leave it to the recipe"
    assert len(notes) == len(BETWEEN)
    assert unanswered(SITE, actuation.default_rules()) == ()
