"""The time step is fine enough that no trajectory depends on it, in closed loop with the climate computer."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.greenhouse import GreenhouseParameters, recipe, simulate
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, WINTER, hours


def day(weather: Telemetry, start: np.datetime64, tick: float) -> Telemetry:
    season = simulate(
        GreenhouseParameters(), weather, recipe, start, start + hours(24), seed=3, sensors=EXACT, disturbances=QUIET,
        tick=tick,
    )  # fmt: skip
    return season.true


@pytest.mark.parametrize("season", ["winter", "spring"])
def test_half_the_step_gives_the_same_day(season: str, request: pytest.FixtureRequest) -> None:
    weather: Telemetry = request.getfixturevalue(season)
    start = WINTER if season == "winter" else SPRING
    whole, half = day(weather, start, 60.0), day(weather, start, 30.0)
    for name, allowed in (("air_temperature", 0.02), ("air_humidity", 0.2), ("air_co2", 1.0)):
        difference = np.abs(whole[name] - half[name]).max()
        assert 0.0 < difference < allowed, name


def test_the_error_of_the_climate_step_is_of_second_order(winter: Telemetry) -> None:
    from igrow.core.greenhouse.climate import advance
    from igrow.core.greenhouse.climate_state import Conditions, initial
    from igrow.core.namespace import FloatNamespace

    conditions = Conditions(
        outdoor_temperature=2.0, outdoor_vapour=0.004, outdoor_co2=7.6e-4, wind_speed=4.0, sky_temperature=-8.0,
        energy_closure=0.5, blackout_closure=0.0, vent_exchange=2e-3, air_exchange=3e-4, leaf_area_index=2.5,
        canopy_conductance=5e-3, sun_canopy=60.0, sun_floor=20.0, sun_cover=10.0, sun_screen=2.0, lamp_long_wave=10.0,
        heat=20.0, vapour=0.0, co2=1e-6, rail_heat=60.0, grow_heat=10.0,
    )  # fmt: skip

    def after_half_an_hour(seconds: float) -> float:
        state = initial(FloatNamespace, 19.0, 75.0, 600.0, 2.0)
        for _ in range(round(1800 / seconds)):
            state, _ = advance(FloatNamespace, GreenhouseParameters(), state, conditions, seconds)
        return float(state.air)

    exact = after_half_an_hour(2.5)
    errors = [abs(after_half_an_hour(seconds) - exact) for seconds in (60.0, 30.0)]
    assert errors[1] < errors[0] / 2.8


@pytest.mark.parametrize("wind", [0.0, 40.0])
def test_no_weather_makes_the_step_unstable(wind: float) -> None:
    from igrow.core.greenhouse.climate import advance
    from igrow.core.greenhouse.climate_state import Conditions, initial
    from igrow.core.namespace import FloatNamespace

    state = initial(FloatNamespace, 19.0, 75.0, 600.0, -20.0)
    conditions = Conditions(
        outdoor_temperature=-20.0, outdoor_vapour=0.0009, outdoor_co2=7.9e-4, wind_speed=wind, sky_temperature=-40.0,
        energy_closure=0.0, blackout_closure=0.0, vent_exchange=0.03 * wind, air_exchange=0.01 * wind,
        leaf_area_index=0.1, canopy_conductance=2e-4, sun_canopy=0.0, sun_floor=0.0, sun_cover=0.0, sun_screen=0.0,
        lamp_long_wave=0.0, heat=0.0, vapour=0.0, co2=0.0, rail_heat=0.0, grow_heat=0.0,
    )  # fmt: skip
    for _ in range(300):
        state, _ = advance(FloatNamespace, GreenhouseParameters(), state, conditions, 60.0)
        assert -40.0 < state.air < 20.0
        assert state.vapour > 0.0
