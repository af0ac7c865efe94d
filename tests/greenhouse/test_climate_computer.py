"""What the PLC does by itself with a setpoint."""

from __future__ import annotations

import pytest

from igrow.core.greenhouse.climate_computer import ClimateComputer, Control, Readings, at_rest, control
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.namespace import FloatNamespace

MILD = Readings(
    air_temperature=20.0, air_humidity=75.0, air_co2=600.0, rail_temperature=30.0, grow_temperature=25.0,
    outdoor_temperature=8.0, global_radiation=0.0, wind_speed=3.0,
)  # fmt: skip
SETPOINTS = {"heating_setpoint": 20.0, "co2_setpoint": 800.0, "lamp_on": 0.0, "irrigation_on": 0.0}


def settle(seen: Readings, minutes: int = 120, **setpoints: float) -> Control:
    state = at_rest(1.0)
    for _ in range(minutes):
        state = control(
            FloatNamespace, ClimateComputer(), GreenhouseParameters(), state, {**SETPOINTS, **setpoints}, seen, 60.0
        )
    return state


def test_cold_air_is_heated_and_warm_air_is_not() -> None:
    assert settle(MILD._replace(air_temperature=18.0)).rail_heat > 20.0
    warm = settle(MILD._replace(air_temperature=24.0))
    assert warm.rail_heat == warm.grow_heat == 0.0


def test_colder_weather_asks_for_hotter_pipes() -> None:
    mild, cold = (settle(MILD._replace(air_temperature=19.5, outdoor_temperature=degrees)) for degrees in (8.0, -5.0))
    assert cold.rail_heat > mild.rail_heat + 10.0


def test_the_boiler_gives_no_more_than_it_can() -> None:
    state = settle(MILD._replace(air_temperature=10.0, outdoor_temperature=-20.0))
    assert state.rail_heat + state.grow_heat == pytest.approx(GreenhouseParameters().boiler_capacity)


def test_lee_vents_open_before_wind_vents() -> None:
    openings = [settle(MILD._replace(air_temperature=20.0 + excess)) for excess in (1.0, 4.0, 16.0)]
    assert openings[0].vent_lee == openings[0].vent_wind == 0.0
    assert openings[1].vent_lee > 0.1
    assert openings[1].vent_wind == 0.0
    assert openings[2].vent_lee == openings[2].vent_wind == 1.0


def test_moist_air_opens_the_vents() -> None:
    assert settle(MILD._replace(air_humidity=95.0)).vent_lee > 0.15


def test_a_storm_shuts_the_wind_vents_and_frost_almost_all() -> None:
    hot = MILD._replace(air_temperature=36.0)
    storm = settle(hot._replace(wind_speed=20.0))
    assert (storm.vent_wind, storm.vent_lee) == (0.0, 0.5)
    frost = settle(hot._replace(outdoor_temperature=-5.0))
    assert frost.vent_wind == 0.0
    assert frost.vent_lee == pytest.approx(0.1)


def test_a_vent_takes_its_time() -> None:
    state = settle(MILD._replace(air_temperature=36.0), minutes=3)
    assert state.vent_lee == pytest.approx(180.0 / ClimateComputer().vent_travel)


def test_the_energy_screen_closes_on_cold_nights_only() -> None:
    assert settle(MILD).energy_screen > 0.9
    assert settle(MILD._replace(global_radiation=200.0)).energy_screen == 0.0
    assert settle(MILD._replace(outdoor_temperature=16.0)).energy_screen == 0.0


def test_the_blackout_screen_closes_while_lamps_burn_at_night() -> None:
    assert settle(MILD, lamp_on=1.0).blackout_screen > 0.9
    assert settle(MILD, lamp_on=0.0).blackout_screen == 0.0
    assert settle(MILD._replace(global_radiation=100.0), lamp_on=1.0).blackout_screen == 0.0


def test_strong_light_puts_the_lamps_off() -> None:
    assert settle(MILD._replace(global_radiation=100.0), lamp_on=1.0).lamp == 1.0
    assert settle(MILD._replace(global_radiation=600.0), lamp_on=1.0).lamp == 0.0


def test_co2_is_dosed_by_day_up_to_the_setpoint_and_not_through_open_vents() -> None:
    day = MILD._replace(global_radiation=300.0)
    assert settle(day).co2_dosing == pytest.approx(GreenhouseParameters().co2_capacity)
    assert settle(day._replace(air_co2=820.0)).co2_dosing == 0.0
    assert settle(MILD).co2_dosing == 0.0
    assert settle(day._replace(air_temperature=36.0)).co2_dosing == 0.0


def test_irrigation_comes_in_pulses_by_radiation_and_only_when_permitted() -> None:
    def pulses(radiation: float, permitted: float) -> tuple[float, int]:
        state, litres, count, before = at_rest(1.0), 0.0, 0, 0.0
        for _ in range(24 * 60):
            state = control(
                FloatNamespace, ClimateComputer(), GreenhouseParameters(), state,
                {**SETPOINTS, "irrigation_on": permitted}, MILD._replace(global_radiation=radiation), 60.0,
            )  # fmt: skip
            litres += state.irrigation / 60.0
            count += state.irrigation > 0.0 and before == 0.0
            before = state.irrigation
        return litres, count

    assert pulses(300.0, 0.0) == (0.0, 0)
    dark, bright = pulses(0.0, 1.0), pulses(300.0, 1.0)
    assert dark[1] in (7, 8)
    assert bright[1] > 3 * dark[1]
    assert bright[0] == pytest.approx(bright[1] * 0.3, abs=0.31)


def test_the_realised_heating_setpoint_ramps() -> None:
    state = settle(MILD, minutes=10, heating_setpoint=25.0)
    assert state.heating_setpoint == pytest.approx(17.0 + ClimateComputer().heating_ramp / 6.0)


def test_a_humidity_setpoint_takes_the_place_of_the_computers_own() -> None:
    computer, moist = ClimateComputer(), MILD._replace(air_humidity=92.0)
    own = settle(moist).vent_lee
    assert settle(moist, humidity_setpoint=computer.humidity_start).vent_lee == own
    assert settle(moist, humidity_setpoint=92.0).vent_lee == 0.0
    assert settle(moist, humidity_setpoint=80.0).vent_lee == pytest.approx(computer.humidity_opening)


def test_a_ventilation_setpoint_takes_the_place_of_the_offset_and_is_never_below_the_heating() -> None:
    computer, warm = ClimateComputer(), MILD._replace(air_temperature=23.0)
    own = settle(warm).vent_lee
    line = SETPOINTS["heating_setpoint"] + computer.ventilation_offset
    assert own > 0.1
    assert settle(warm, ventilation_setpoint=line).vent_lee == pytest.approx(own)
    assert settle(warm, ventilation_setpoint=23.0).vent_lee == 0.0
    below = settle(warm, ventilation_setpoint=10.0).vent_lee
    assert below == pytest.approx(settle(warm, ventilation_setpoint=SETPOINTS["heating_setpoint"]).vent_lee)


def test_a_minimum_pipe_is_heated_in_warm_air_and_the_energy_screen_keeps_to_its_own_setpoint() -> None:
    warm = MILD._replace(air_temperature=23.0, rail_temperature=23.0, grow_temperature=23.0)
    assert settle(warm).rail_heat == 0.0
    held = settle(warm, minimum_pipe_setpoint=40.0)
    assert held.rail_heat > 20.0
    assert held.grow_heat == 0.0
    night = MILD._replace(global_radiation=0.0, outdoor_temperature=-5.0, air_humidity=60.0)
    assert settle(night).energy_screen > 0.9
    assert settle(night, energy_screen_setpoint=40.0).energy_screen == pytest.approx(0.4)
