"""Effects at their shapes, and patterns that outside drivers alone determine."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.data import Log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design import candidates, sensitivity
from igrow.trainer.diagnosis.design.balances import balances_of
from igrow.trainer.diagnosis.design.candidates import UNIT_FLUX, Candidate, Pattern
from igrow.trainer.diagnosis.design.sensitivity import Linearisation
from igrow.trainer.diagnosis.knowledge import ActiveTerm, activate
from igrow.trainer.fit.solver import DivergenceError
from tests.virtual_log import SITE

DAY = 96


@pytest.fixture(scope="module")
def record(quiet_log: Log) -> Record:
    return quiet_log.record(0.0)


@pytest.fixture(scope="module")
def line(record: Record) -> Linearisation:
    runs = sensitivity.day_runs(record, split_days(record, SITE.longitude).day)
    return sensitivity.linearise(record, runs, nominal(SITE), {})


@pytest.fixture(scope="module")
def courses(record: Record) -> dict[str, Floats]:
    return {when: course for when, _, course in candidates.patterns(record, SITE.longitude)}


def test_a_window_of_the_clock_follows_the_sun_and_may_pass_midnight(
    courses: dict[str, Floats], record: Record
) -> None:
    hour = np.asarray(record.inputs["hour"])
    np.testing.assert_array_equal(courses["05 to 09 h"], ((hour >= 5) & (hour < 9)).astype(float))
    np.testing.assert_array_equal(courses["19 to 05 h"], ((hour >= 19) | (hour < 5)).astype(float))


def test_weekdays_are_those_of_the_calendar(courses: dict[str, Floats]) -> None:
    # The log begins on Saturday, 1 February 2020, 18 minutes after local solar midnight.
    working = courses["working days"]
    assert working[: 2 * DAY - 4].max() == 0.0
    assert working[2 * DAY : 7 * DAY - 4].min() == 1.0
    monday = courses["06 to 10 h on Mondays"]
    assert monday[: 2 * DAY].max() == 0.0
    assert monday[2 * DAY + 24 : 2 * DAY + 38].min() == 1.0


def test_weather_enters_in_round_units(courses: dict[str, Floats], record: Record) -> None:
    outdoor = np.asarray(record.inputs["outdoor_temperature"])
    np.testing.assert_allclose(courses["cold weather"], np.maximum(8.0 - outdoor, 0.0) / 8.0)
    np.testing.assert_allclose(courses["wind speed"], record.inputs["wind_speed"] / 5.0)
    assert courses["from day to day"][30 * 60] == pytest.approx(30 * 60 * 900.0 / 86_400.0 / 30.0)


def test_what_follows_an_hour_late_settles_at_what_it_follows(courses: dict[str, Floats]) -> None:
    lamps, late = courses["lamp power on"], courses["an hour after lamp power"]
    begun = int(np.flatnonzero(np.diff(lamps) > 0.3)[0]) + 1
    level = lamps[begun]
    # A first-order lag of an hour: 1 - exp(-1) after four quarters of an hour.
    assert late[begun + 3] - late[begun - 1] * np.exp(-1.0) == pytest.approx(level * (1.0 - np.exp(-1.0)), rel=1e-6)


def test_a_store_of_a_day_remembers_the_light(courses: dict[str, Floats], record: Record) -> None:
    stored = courses["light of the last days"]
    light = (0.3 * np.asarray(record.inputs["global_radiation"]) + 0.5 * np.asarray(record.inputs["lamp_power"])) / 15.0
    day = round(86_400.0 / record.step)
    # It begins with its first day's mean, moves by a share of its distance from the light, and keeps the mean.
    assert stored[0] == pytest.approx(light[:day].mean(), rel=0.05)
    moved = np.diff(stored) / (1.0 - np.exp(-record.step / 86_400.0))
    np.testing.assert_allclose(moved, (light - np.append(light[:day].mean(), stored[:-1]))[1:], atol=1e-9)
    assert stored.mean() == pytest.approx(light.mean(), rel=0.1)


def test_without_a_pyranometer_nothing_remembers_the_light(quiet_log: Log) -> None:
    dark = quiet_log.without("global_radiation").record(0.0)
    assert "light of the last days" not in {when for when, _, _ in candidates.patterns(dark, SITE.longitude)}


def test_nothing_that_control_answers_to_drives_a_pattern(record: Record) -> None:
    drivers = {driver for _, names, _ in candidates.patterns(record, SITE.longitude) for driver in names}
    assert not drivers & {
        "air_temperature",
        "air_humidity",
        "air_co2",
        "rail_pipe_temperature",
        "vent_lee",
        "vent_wind",
    }


def test_lamps_without_a_power_are_followed_by_their_switch(quiet_log: Log) -> None:
    dark = quiet_log.without("lamp_power").record(0.0)
    drivers = [names for _, names, _ in candidates.patterns(dark, SITE.longitude)]
    assert ("lamp_on",) in drivers
    assert ("lamp_power",) not in drivers


def test_fluxes_of_patterns_add_up_by_channel(record: Record, courses: dict[str, Floats]) -> None:
    cold, clock = Pattern("heat", "cold weather", ()), Pattern("heat", "05 to 09 h", ())
    rain = Pattern("co2", "all the time", ())
    fluxes = candidates.pattern_fluxes(record, SITE.longitude, {cold: 0.5, clock: -2.0, rain: 1.0})
    assert set(fluxes) == {"heat", "co2"}
    exact = UNIT_FLUX["heat"] * (0.5 * courses["cold weather"] - 2.0 * courses["05 to 09 h"])
    np.testing.assert_allclose(fluxes["heat"], exact)


def test_a_column_is_what_a_small_flux_changes(line: Linearisation, courses: dict[str, Floats]) -> None:
    flux = UNIT_FLUX["heat"] * courses["05 to 09 h"]
    (column,) = sensitivity.flux_sensitivities(line, [({"heat": flux}, 0.1)])
    moved = sensitivity.linearise(line.record, line.runs, line.parameters, {}, {"heat": 0.1 * flux})
    np.testing.assert_allclose(
        0.1 * column[line.runs.weight], (moved.errors - line.errors)[line.runs.weight], atol=1e-10
    )


def test_many_fluxes_at_once_are_those_of_one_at_a_time(line: Linearisation, courses: dict[str, Floats]) -> None:
    fluxes = [
        ({"heat": courses["cold weather"]}, 0.1),
        ({"vapour": 1e-6 * courses["05 to 09 h"], "heat": np.ones(len(line.record))}, 0.2),
    ]
    together = sensitivity.flux_sensitivities(line, fluxes)
    for one, column in zip(fluxes, together, strict=True):
        np.testing.assert_array_equal(sensitivity.flux_sensitivities(line, [one])[0], column)


def test_a_flux_into_no_balance_moves_nothing(line: Linearisation) -> None:
    assert not sensitivity.flux_sensitivities(line, [({}, 0.1)]).any()
    assert sensitivity.flux_sensitivities(line, []).shape[0] == 0


def test_an_offset_of_a_sensor_leaves_the_plant_alone(line: Linearisation) -> None:
    column = sensitivity.sensor_sensitivities(line, [(EFFECTS["co2_offset"], {})])[0]
    # The start of a run is corrected by the offset, and with the hours the air forgets its start.
    assert np.median(column[2][:, -1]) == pytest.approx(-1.0, abs=0.1)
    assert np.abs(column[2][:, 0]).max() < 0.5
    assert np.abs(column[0]).max() < 1e-3


def test_faults_of_sensors_together_move_the_errors_as_each_alone(line: Linearisation) -> None:
    faults = [
        (effect, {shape.name: shape.typical for shape in effect.shapes})
        for effect in EFFECTS.values()
        if effect.kind == "sensor"
    ]
    together = sensitivity.sensor_sensitivities(line, faults)
    for one, column in zip(faults, together, strict=True):
        np.testing.assert_array_equal(sensitivity.sensor_sensitivities(line, [one])[0], column)
    assert sensitivity.sensor_sensitivities(line, []).shape[0] == 0


def test_parameters_move_the_errors_as_a_run_at_another_value_does(line: Linearisation) -> None:
    names = ("leakage_wind", "transmissivity")
    spread = np.array([0.1 * line.parameters[name] for name in names])
    columns = sensitivity.parameter_sensitivities(line, names, spread)
    for name, change, column in zip(names, spread, columns, strict=True):
        small = 0.05 * change
        moved = sensitivity.linearise(
            line.record, line.runs, {**line.parameters, name: line.parameters[name] + small}, {}
        )
        np.testing.assert_allclose(
            (column * line.runs.weight) * small, (moved.errors - line.errors) * line.runs.weight, atol=1e-8
        )


def test_an_effect_is_tried_at_every_shape_of_its_grid_and_has_a_key_for_each(line: Linearisation) -> None:
    found = candidates.effect_columns(line)
    asked = {one.key for one in found.candidates}
    assert len(asked) == len(found.candidates)
    assert {f"wind_infiltration:exponent={value:g}" for value in (0.7, 1.0, 1.5, 2.0)} <= asked
    assert Candidate("co2_drift", ()).ages
    ageing = {one.effect for one, column in zip(found.candidates, found.ageing, strict=True) if column.any()}
    assert ageing == {one.effect for one in found.candidates if one.ages}
    # The log has no rain and no irrigation to speak of, and says so.
    assert "rain_cooling" in found.untestable
    assert asked.isdisjoint(found.untestable)


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("lamp_heat", {"share": 1e300}),
        ("lamp_heat", {"share": 100.0}),
        ("co2_valve_leak", {"rate": 1e9}),
    ],
)
def test_a_model_that_runs_out_of_all_bounds_says_so_though_its_air_has_a_temperature(
    line: Linearisation, effect: str, values: dict[str, float]
) -> None:
    with pytest.raises(DivergenceError, match=f"{effect} runs out of all bounds"):
        sensitivity.linearise(line.record, line.runs, line.parameters, {effect: values})


@pytest.mark.parametrize("runaway", [np.nan, np.inf, 1e274])
def test_an_effect_that_runs_out_of_all_bounds_a_little_further_on_is_none_that_the_log_tells(
    line: Linearisation, monkeypatch: pytest.MonkeyPatch, runaway: float
) -> None:
    def diverged(*asked: Any) -> Any:
        columns = sensitivity.sensor_sensitivities(*asked)
        columns[0, 0, 0, -1] = runaway
        return columns

    monkeypatch.setattr(candidates, "sensor_sensitivities", diverged)
    first = next(one.name for one in EFFECTS.values() if one.kind == "sensor")
    found = candidates.effect_columns(line)
    assert first in found.untestable
    assert first not in {one.effect for one in found.candidates}
    assert np.isfinite(found.columns).all()


def test_where_the_errors_do_not_count_the_model_may_show_anything(
    line: Linearisation, monkeypatch: pytest.MonkeyPatch
) -> None:
    weight = line.runs.weight.copy()
    weight[2] = False
    blind = replace(line, runs=replace(line.runs, weight=weight))

    def diverged(*asked: Any) -> Any:
        columns = sensitivity.flux_sensitivities(*asked)
        columns[:, 2] = np.nan
        return columns

    usual = candidates.effect_columns(blind), candidates.pattern_columns(blind, SITE.longitude)
    monkeypatch.setattr(candidates, "flux_sensitivities", diverged)
    effects, (patterns, columns) = candidates.effect_columns(blind), candidates.pattern_columns(blind, SITE.longitude)
    assert (effects.candidates, effects.untestable, patterns) == (usual[0].candidates, usual[0].untestable, usual[1][0])
    counted = balances_of(blind, DEFAULT)
    assert counted.numbers == (0, 1)
    assert np.isfinite(counted(effects.columns)).all() and np.isfinite(counted(columns)).all()
    # Nor where a run has left the steps that are driven.
    late = replace(counted, observed=counted.observed & (np.arange(line.runs.steps) < 40))
    columns[:, :, :, 40:] = np.inf
    assert np.isfinite(late(columns)).all()


@pytest.mark.parametrize("runaway", [np.nan, np.inf, 1e274])
def test_a_pattern_that_runs_out_of_all_bounds_a_little_further_on_is_not_asked(
    line: Linearisation, monkeypatch: pytest.MonkeyPatch, runaway: float
) -> None:
    """About stomata that close two ran away on one day of 27, and with them every gain of the log was no number."""
    usual, columns = candidates.pattern_columns(line, SITE.longitude)

    def diverged(*asked: Any) -> Any:
        columns = sensitivity.flux_sensitivities(*asked)
        columns[0, 0, 0, -1] = runaway
        return columns

    monkeypatch.setattr(candidates, "flux_sensitivities", diverged)
    found, others = candidates.pattern_columns(line, SITE.longitude)
    assert found == usual[1:]
    np.testing.assert_array_equal(others, columns[1:])


def test_a_pipe_sensor_can_be_off_in_a_greenhouse_without_a_grow_pipe(record: Record) -> None:
    offset = EFFECTS["pipe_temperature_offset"]
    one = replace(record, missing=(*record.missing, "grow_pipe_temperature"))
    none = replace(one, missing=(*one.missing, "rail_pipe_temperature"))
    assert sensitivity.is_measured(one, offset)
    assert not sensitivity.is_measured(none, offset)


def test_a_leak_may_be_hidden_where_the_log_has_no_wind_and_not_where_it_has(line: Linearisation) -> None:
    blind = replace(line, record=replace(line.record, missing=(*line.record.missing, "wind_speed", "wind_direction")))
    assert candidates.hidden_by_missing_weather(line) == ()
    assert candidates.hidden_by_missing_weather(blind) == ("wind_infiltration",)


def test_other_effects_in_one_run_with_parameters_move_the_errors_as_alone(line: Linearisation) -> None:
    begins = line.record.time[len(line.record) // 2]
    terms = [
        ActiveTerm("air_temperature_offset", 0.4, {}, begins),
        ActiveTerm("wind_infiltration", 0.1, {"exponent": 1.2}),
        ActiveTerm("soil_heat_storage", 2.0, {"time_constant": 4.0}),
    ]
    about = sensitivity.linearise(line.record, line.runs, line.parameters, activate(line.record, terms))
    others = [
        (activate(line.record, [replace(terms[0], amplitude=0.5), *terms[1:]]), 0.1),
        (activate(line.record, [terms[0], replace(terms[1], shape={"exponent": 1.3}), terms[2]]), 0.1),
        (activate(line.record, [*terms[:2], replace(terms[2], shape={"time_constant": 3.5})]), -0.5),
    ]
    names, spread = ("leakage_wind",), np.array([0.1])
    alone = sensitivity.parameter_sensitivities(about, names, spread)
    together = sensitivity.parameter_sensitivities(about, names, spread, others)
    np.testing.assert_allclose(together[:1], alone, rtol=1e-9, atol=1e-12)
    for (effects, amount), column in zip(others, together[1:], strict=True):
        moved = sensitivity.linearise(line.record, line.runs, line.parameters, effects)
        assert np.abs(column).max() > 0.0
        np.testing.assert_allclose(column, -(moved.shown - about.shown) / amount, rtol=1e-6, atol=1e-9)
