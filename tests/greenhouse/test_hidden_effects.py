"""Effects in the plant: of the catalogue and not, at a chosen size, form and start, unseen by any model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.greenhouse import GreenhouseParameters, HiddenEffect, recipe, simulate_many
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.hidden import REFERENCE_DRIVERS, EffectBank
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.namespace import FloatNamespace
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, hours

EVERY = [*EFFECTS, *UNCATALOGUED]
QUIET_FOR = {"rain_cooling", "photosynthesis_heat_limit"}
"""Effects whose driver need not occur in the days of the test: it did not rain, it was not hot."""


@pytest.fixture(scope="module")
def with_each(spring: Telemetry) -> dict[str | None, Telemetry]:
    """Most of a Monday in a greenhouse without any effect (None) and with each one, which began a month before."""
    effects = [[], *[[HiddenEffect(name, start=SPRING - hours(24 * 30), shapes=_early(name))] for name in EVERY]]
    seasons = simulate_many(
        GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(22), count=len(effects), seed=1,
        effects=effects, disturbances=QUIET, sensors=EXACT,
    )  # fmt: skip
    return {name: season.measured for name, season in zip([None, *EVERY], seasons, strict=True)}


def _early(name: str) -> dict[str, float]:
    return {"threshold": 0.4} if name == "deficit_stomata_closure" else {}


@pytest.mark.parametrize("name", [name for name in EVERY if name not in QUIET_FOR])
def test_every_effect_shows_in_the_log(name: str, with_each: dict[str | None, Telemetry]) -> None:
    without, log = with_each[None], with_each[name]
    moved = max(
        np.abs(log[quantity] - without[quantity]).max() / scale
        for quantity, scale in (("air_temperature", 1.0), ("air_humidity", 5.0), ("air_co2", 50.0), ("vent_lee", 20.0),
                                ("rail_pipe_temperature", 10.0))
    )  # fmt: skip
    assert moved > 0.005
    assert all(np.isfinite(values).all() for values in log.columns.values())


def test_a_sensor_fault_is_in_the_measurement_and_the_plc_follows_it(spring: Telemetry) -> None:
    from igrow.core.greenhouse import simulate

    season = simulate(
        GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(24), seed=1, disturbances=QUIET, sensors=EXACT,
        effects=[HiddenEffect("air_temperature_offset", 1.5)],
    )  # fmt: skip
    np.testing.assert_allclose(season.measured["air_temperature"][2:] - season.true["air_temperature"][2:], 1.5)
    night = slice(3, 30)
    assert (
        np.abs(season.measured["air_temperature"][night].mean() - season.true["heating_setpoint"][night].mean()) < 1.0
    )


def evaluate(effect: HiddenEffect, now: float = 0.0, repeat: int = 1, **drivers: float) -> float:
    bank = EffectBank(FloatNamespace, [effect], None, 0.0)
    memory: list[Any] = []
    for _ in range(repeat):
        result = bank.evaluate({**REFERENCE_DRIVERS, **drivers}, now, 60.0, memory)
    return float(next(iter(result.values())))


def test_size_is_the_catalogues_amplitude() -> None:
    one, two = (evaluate(HiddenEffect("wind_infiltration", size)) for size in (0.1, 0.2))
    assert one == pytest.approx(0.1 * 4.0 * REFERENCE_DRIVERS["mean_height"] / 3600.0)
    assert two == pytest.approx(2.0 * one)


def test_the_exponent_bends_the_form_and_keeps_the_reference() -> None:
    straight = HiddenEffect("wind_infiltration", 0.1)
    bent = HiddenEffect("wind_infiltration", 0.1, exponent=2.0)
    assert evaluate(bent, wind_speed=4.0) == pytest.approx(evaluate(straight, wind_speed=4.0))
    assert evaluate(bent, wind_speed=8.0) == pytest.approx(2.0 * evaluate(straight, wind_speed=8.0))
    assert evaluate(bent, wind_speed=2.0) == pytest.approx(0.5 * evaluate(straight, wind_speed=2.0))


def test_below_the_threshold_there_is_nothing() -> None:
    effect = HiddenEffect("wind_infiltration", 0.1, threshold=0.5)
    assert evaluate(effect, wind_speed=1.9) == 0.0
    assert evaluate(effect, wind_speed=4.0) == pytest.approx(0.5 * evaluate(HiddenEffect("wind_infiltration", 0.1)))


def test_the_delay_is_a_first_order_lag() -> None:
    effect = HiddenEffect("lamp_heat", delay_seconds=600.0)
    final = evaluate(HiddenEffect("lamp_heat"))
    assert evaluate(effect, repeat=10) == pytest.approx(final * (1.0 - np.exp(-1.0)))


def test_before_its_start_an_effect_is_silent() -> None:
    effect = HiddenEffect("wind_infiltration", 0.1, start=np.datetime64(1000, "s"))
    assert evaluate(effect, now=999.0) == 0.0
    assert evaluate(effect, now=1000.0) > 0.0


def test_a_drift_counts_from_its_start() -> None:
    day = 86_400.0
    effect = HiddenEffect("co2_drift", start=np.datetime64(int(10 * day), "s"))
    first, second = evaluate(effect, now=15 * day), evaluate(effect, now=20 * day)
    assert second == pytest.approx(2.0 * first)


def test_an_unknown_effect_or_shape_is_refused_by_name() -> None:
    with pytest.raises(IgrowError, match="no effect is called 'wind_leak'"):
        HiddenEffect("wind_leak")
    with pytest.raises(IgrowError, match="no parameter 'power'"):
        HiddenEffect("wind_infiltration", shapes={"power": 2.0})


def test_at_least_six_causes_are_not_in_the_catalogue() -> None:
    assert len(UNCATALOGUED) >= 6
    assert not set(UNCATALOGUED) & set(EFFECTS)


def test_a_crop_that_has_lost_all_its_assimilation_loses_no_more(spring: Telemetry) -> None:
    """Two hundred per cent less would be CO2 that it gives off, more of it the more there is, without an end."""
    decline = HiddenEffect("photosynthesis_decline", 2.0, SPRING - hours(24 * 100), exponent=1.3)
    (season,) = simulate_many(
        GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(22), count=1, seed=1, effects=[decline],
        disturbances=QUIET, sensors=EXACT,
    )  # fmt: skip
    assert all(np.isfinite(values).all() for values in season.measured.columns.values())
    assert 300.0 < season.measured["air_co2"].min() < season.measured["air_co2"].max() < 3000.0


def test_a_crop_loses_the_share_of_its_assimilation_that_is_hidden_and_no_less(spring: Telemetry) -> None:
    """Taken of what is left, a half would lose a third, and a third a quarter."""
    noon = float(unix_seconds(SPRING + hours(12)))
    declines = [
        [HiddenEffect("photosynthesis_decline", loss, SPRING + hours(12 - 24 * 100))] for loss in (0.0, 0.5, 1.0)
    ]
    plant = Plant(GreenhouseParameters(), WeatherTable(spring), noon, count=3, effects=declines, disturbances=QUIET)
    setpoints = recipe(SPRING + hours(12))
    plant.advance(600.0, setpoints)  # until the air is at rest: an effect is of the crop of a tick ago
    before = plant.state.totals["co2_taken_up"].copy()
    plant.advance(120.0, setpoints)
    whole, half, none = plant.state.totals["co2_taken_up"] - before
    assert half / whole == pytest.approx(0.5, abs=0.02)
    assert none / whole == pytest.approx(0.0, abs=0.02)
