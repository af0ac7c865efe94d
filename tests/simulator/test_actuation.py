"""The climate computer's rules."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.core.quantities import QUANTITIES, USUAL_SETPOINTS
from igrow.core.quantities import SETPOINTS as SETPOINTS_OF_ALL
from igrow.core.simulator import actuation
from igrow.core.simulator.actuation import RULES, default_rules
from tests.setpoint_tables import OPTIONAL

SETPOINTS = {"heating_setpoint": 20.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
OTHERS = dict(zip(actuation.ANSWERS, OPTIONAL, strict=True))
WEATHER = {"outdoor_temperature": 5.0, "global_radiation": 0.0, "wind_speed": 3.0}
CLIMATE = {"air_temperature": 20.0, "air_humidity": 80.0, "air_co2": 700.0, "par": 100.0}
REST = {
    "rail_pipe_temperature": 20.0,
    "grow_pipe_temperature": 20.0,
    "vent_lee": 0.0,
    "vent_wind": 0.0,
    "energy_screen": 0.0,
    "blackout_screen": 0.0,
}


def targets(**changes: float) -> dict[str, float]:
    def changed(table: dict[str, float]) -> dict[str, float]:
        return {name: changes.get(name, value) for name, value in table.items()}

    found = actuation.targets(
        np, changed(SETPOINTS), changed(WEATHER), changed(CLIMATE), changed(REST), default_rules()
    )
    return {name: float(value) for name, value in found.items()}


def test_a_cold_greenhouse_is_heated_and_a_warm_one_aired() -> None:
    assert targets(air_temperature=18.0)["rail_pipe_temperature"] > targets()["rail_pipe_temperature"] + 5.0
    assert targets(air_temperature=28.0)["vent_lee"] > 20.0
    assert targets(air_temperature=18.0)["vent_lee"] == 0.0


def test_co2_is_dosed_in_the_light_only_and_more_when_it_is_short() -> None:
    assert targets(lamp_on=0.0)["co2_dosing"] == 0.0
    assert targets(air_co2=500.0)["co2_dosing"] > targets(air_co2=700.0)["co2_dosing"]


def test_screens_close_in_the_dark_and_open_in_the_sun() -> None:
    assert targets()["energy_screen"] > 80.0
    assert targets(global_radiation=500.0)["energy_screen"] == 0.0


@settings(max_examples=200, deadline=None)
@given(
    rules=st.lists(st.floats(0.0, 1.0), min_size=len(RULES), max_size=len(RULES)),
    temperature=st.floats(-10.0, 50.0),
    setpoint=st.floats(5.0, 35.0),
    outdoor=st.floats(-30.0, 40.0),
    humidity=st.floats(0.0, 100.0),
    radiation=st.floats(0.0, 1200.0),
    wind=st.floats(0.0, 40.0),
    lamp=st.floats(0.0, 1.0),
)
def test_whatever_rules_and_climate_are_the_actuators_stay_in_range(
    rules: list[float],
    temperature: float,
    setpoint: float,
    outdoor: float,
    humidity: float,
    radiation: float,
    wind: float,
    lamp: float,
) -> None:
    values = {
        name: rule.low + share * (rule.high - rule.low)
        for share, (name, rule) in zip(rules, RULES.items(), strict=True)
    }
    out = actuation.act(
        np,
        SETPOINTS | OTHERS | {"heating_setpoint": setpoint, "lamp_on": lamp},
        {"outdoor_temperature": outdoor, "global_radiation": radiation, "wind_speed": wind},
        CLIMATE | {"air_temperature": temperature, "air_humidity": humidity},
        REST,
        values,
        seconds=300.0,
    )
    for name in ("vent_lee", "vent_wind", "energy_screen", "blackout_screen", "lamp_power", "co2_dosing"):
        assert QUANTITIES[name].low - 1e-9 <= out[name] <= QUANTITIES[name].high + 1e-9
    assert out["rail_pipe_temperature"] <= temperature + 80.0 + 1e-6 or out["rail_pipe_temperature"] <= 20.0


def test_a_position_moves_towards_its_target_and_not_past_it() -> None:
    hot = CLIMATE | {"air_temperature": 30.0}
    out = actuation.act(np, SETPOINTS, WEATHER, hot, REST, default_rules(), seconds=300.0)
    aim = actuation.targets(np, SETPOINTS, WEATHER, hot, REST, default_rules())["vent_lee"]
    assert 0.0 < out["vent_lee"] < aim


def vents(humidity: float, temperature: float = 20.0, **more: float) -> tuple[float, float]:
    """Return where the lee vents go under a humidity setpoint of 85 %, and where the windward ones do."""
    rules = default_rules() | {"lee_humidity": 0.0, "windward_humidity": 0.0}
    rules |= {"lee_humidity_opening": 0.4, "lee_humidity_band": 10.0}
    seen = CLIMATE | {"air_humidity": humidity, "air_temperature": temperature}
    asked = SETPOINTS | {"humidity_setpoint": 85.0} | more
    found = actuation.targets(np, asked, WEATHER, seen, REST, rules)
    return float(found["vent_lee"]), float(found["vent_wind"])


@pytest.mark.parametrize(("humidity", "opening"), [(80.0, 0.0), (85.0, 0.0), (90.0, 20.0), (95.0, 40.0), (99.0, 40.0)])
def test_damp_air_opens_the_vents_in_a_band_above_its_setpoint(humidity: float, opening: float) -> None:
    lee, windward = vents(humidity)
    assert lee == pytest.approx(opening)
    assert windward == 0.0


def test_a_vent_opens_by_the_larger_of_what_temperature_and_humidity_ask() -> None:
    warm = 32.0
    by_temperature, _ = vents(70.0, warm)
    assert by_temperature > 40.0
    assert vents(99.0, warm)[0] == by_temperature, "a sum would be more"
    slightly = vents(70.0, 22.0)[0]
    assert 0.0 < slightly < 20.0
    assert vents(90.0, 22.0)[0] == pytest.approx(20.0)


@pytest.mark.parametrize("name", actuation.ANSWERS)
def test_a_setpoint_that_no_rule_answers_to_changes_nothing(name: str) -> None:
    for humidity in (60.0, 88.0, 97.0):
        for temperature in (18.0, 22.0, 27.0):
            seen = CLIMATE | {"air_humidity": humidity, "air_temperature": temperature}
            plain, told = (
                actuation.targets(np, SETPOINTS | more, WEATHER, seen, REST, default_rules())
                for more in ({}, {name: 21.0})
            )
            assert plain == told


@pytest.mark.parametrize("name", actuation.ANSWERS)
def test_which_setpoints_rules_answer_to(name: str) -> None:
    assert actuation.setpoints_of(default_rules()) == USUAL_SETPOINTS
    assert actuation.setpoints_of({}) == USUAL_SETPOINTS, "rules of before it was known"
    rules = default_rules() | {actuation.ANSWERS[name][0]: 0.3}
    assert actuation.setpoints_of(rules) == (*USUAL_SETPOINTS, name)
    own = set(actuation.rules_for(SETPOINTS_OF_ALL)) - set(actuation.rules_for(USUAL_SETPOINTS))
    assert set(actuation.ANSWERS[name]) <= set(actuation.rules_of(name)) <= own


def following(name: str, **changes: float) -> dict[str, float]:
    """Return the targets of a computer that follows one more setpoint."""
    rules = default_rules() | dict.fromkeys(actuation.ANSWERS[name], 1.0)
    seen = CLIMATE | {one: value for one, value in changes.items() if one in CLIMATE}
    asked = SETPOINTS | {one: value for one, value in changes.items() if one not in CLIMATE}
    found = actuation.targets(np, asked, WEATHER, seen, REST, rules)
    return {one: float(value) for one, value in found.items()}


def test_vents_open_above_the_ventilation_setpoint_whatever_is_heated_to() -> None:
    warm = {"air_temperature": 24.0}
    offset = RULES["lee_offset"].value
    shut, open_ = (
        following("ventilation_setpoint", ventilation_setpoint=24.0 - offset - above, **warm)["vent_lee"]
        for above in (0.0, 3.0)
    )
    assert (shut, open_ > 10.0) == (0.0, True)
    cooler = following("ventilation_setpoint", ventilation_setpoint=20.0, heating_setpoint=15.0, **warm)
    assert cooler["vent_lee"] == following("ventilation_setpoint", ventilation_setpoint=20.0, **warm)["vent_lee"]


def test_the_pipe_rail_stays_above_a_minimum_pipe_and_the_grow_pipe_does_not_follow_it() -> None:
    warm = {"air_temperature": 26.0}
    held = following("minimum_pipe_setpoint", minimum_pipe_setpoint=40.0, **warm)
    assert (held["rail_pipe_temperature"], held["grow_pipe_temperature"]) == (40.0, 26.0)
    cold = {"air_temperature": 15.0, "minimum_pipe_setpoint": 30.0}
    assert following("minimum_pipe_setpoint", **cold)["rail_pipe_temperature"] > 40.0


def test_the_energy_screen_closes_no_further_than_its_setpoint() -> None:
    assert following("energy_screen_setpoint", energy_screen_setpoint=35.0)["energy_screen"] == 35.0
    whole = following("energy_screen_setpoint", energy_screen_setpoint=100.0)
    assert whole["energy_screen"] == pytest.approx(90.0)
    assert following("energy_screen_setpoint", energy_screen_setpoint=35.0)["blackout_screen"] > 80.0
