"""Any setpoints, any weather, odd parameters: the plant stays finite and physical."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from igrow.core.greenhouse import Disturbances, GreenhouseParameters, generate_weather, recipe, simulate, simulate_many
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.quantities import QUANTITIES
from tests.greenhouse.greenhouse_seasons import SPRING, WINTER, hours

COUNT = 40


def test_wild_setpoints_in_odd_greenhouses_stay_physical() -> None:
    rng = np.random.default_rng(11)
    parameters = [GreenhouseParameters().varied(rng, 0.3) for _ in range(COUNT)]
    places = [
        WeatherClimate(mean_temperature=rng.uniform(-10.0, 28.0), mean_wind=rng.uniform(1.0, 12.0))
        for _ in range(COUNT)
    ]
    start = SPRING
    weather = [generate_weather(start, start + hours(20), seed=n, climate=place) for n, place in enumerate(places)]

    def wild(_time: np.datetime64) -> dict[str, np.ndarray]:
        return {
            "heating_setpoint": rng.uniform(5.0, 35.0, COUNT),
            "co2_setpoint": rng.uniform(300.0, 2000.0, COUNT),
            "lamp_on": rng.uniform(0.0, 1.0, COUNT).round(),
            "irrigation_on": rng.uniform(0.0, 1.0, COUNT),
        }

    seasons = simulate_many(
        parameters, weather, wild, start, start + hours(18), count=COUNT, seed=2, sensors=EXACT,
        disturbances=Disturbances(heat=25.0, vapour=15.0, co2=1.0, degrees_of_freedom=3.0),
    )  # fmt: skip
    for season in seasons:
        for name in (
            "air_temperature",
            "air_co2",
            "rail_pipe_temperature",
            "vent_lee",
            "co2_dosing",
            "leaf_area_index",
        ):
            values = season.true[name]
            assert np.isfinite(values).all(), name
            assert values.min() >= QUANTITIES[name].low, name
            assert values.max() <= QUANTITIES[name].high, name
        assert season.true["air_humidity"].min() > 5.0
        # Supersaturation is possible for minutes, in fog, not as a habit.
        assert season.true["air_humidity"].max() < 115.0


@pytest.mark.slow
def test_unwatered_crops_close_their_stomata() -> None:
    weather = generate_weather(SPRING, SPRING + hours(24 * 6 + 1), seed=3)

    def schedule(permitted: float) -> Callable[[np.datetime64], dict[str, float]]:
        wanted = {"heating_setpoint": 20.0, "co2_setpoint": 600.0, "lamp_on": 0.0, "irrigation_on": permitted}
        return lambda _time: wanted

    wet, dry = (
        simulate(
            GreenhouseParameters(), weather, schedule(share), SPRING, SPRING + hours(24 * 6), seed=1,
        )
        for share in (1.0, 0.0)
    )  # fmt: skip
    last = slice(-288, None)
    assert dry.total("irrigation") == 0.0
    assert dry.true["air_humidity"][last].mean() < wet.true["air_humidity"][last].mean() - 1.5
    gained = [season.true["net_growth"][-1] - season.true["net_growth"][-288] for season in (wet, dry)]
    assert gained[1] < 0.8 * gained[0]


def test_a_mild_winter_day_is_a_growers_day() -> None:
    weather = generate_weather(WINTER, WINTER + hours(24 * 4), seed=5)

    season = simulate(GreenhouseParameters(), weather, recipe, WINTER, WINTER + hours(72), seed=1)
    truth = season.true
    assert 16.0 < truth["air_temperature"].mean() < 22.0
    assert 65.0 < truth["air_humidity"].mean() < 93.0
    assert 400.0 < truth["air_co2"].mean() < 900.0
    assert 5.0 < season.total("heat") < 40.0
    assert 0.05 < season.total("co2") < 0.8
