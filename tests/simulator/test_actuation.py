"""The climate computer's rules."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.core.quantities import QUANTITIES
from igrow.core.simulator import actuation
from igrow.core.simulator.actuation import RULES, default_rules

SETPOINTS = {"heating_setpoint": 20.0, "co2_setpoint": 700.0, "lamp_on": 1.0, "irrigation_on": 0.5}
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


def test_a_cold_house_is_heated_and_a_warm_one_aired() -> None:
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
        SETPOINTS | {"heating_setpoint": setpoint, "lamp_on": lamp},
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
