"""Single equations against values of the literature and against plain reasoning."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.canopy import photosynthesis, stomatal_resistance, vapour_conductance
from igrow.core.greenhouse.light import canopy_absorption, distribute
from igrow.core.greenhouse.linear import solve
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.sky import sky_temperature
from igrow.core.greenhouse.ventilation import leakage, past_screens, through_vents
from igrow.core.namespace import FloatNamespace

P = GreenhouseParameters()


def test_light_is_shared_without_loss() -> None:
    parts = canopy_absorption(FloatNamespace, 0.7, 0.07, 0.5, 2.5)
    assert sum(parts) == pytest.approx(1.0)
    assert 0.75 < parts[0] < 0.95
    light = distribute(FloatNamespace, P, 0.0, 81.0, 2.5, 0.0, 0.0, 0.0)
    assert light.canopy + light.floor + light.lamp_air + light.lamp_long_wave + light.lamp_out == pytest.approx(81.0)
    # The challenge's lamps: 100 umol m-2 s-1.
    assert light.par == pytest.approx(100.0, rel=0.01)


def test_screens_and_losses_dim_the_light() -> None:
    def par(energy: float, blackout: float, loss: float) -> float:
        return float(distribute(FloatNamespace, P, 500.0, 0.0, 2.5, energy, blackout, loss).par)

    clear = par(0.0, 0.0, 0.0)
    assert par(1.0, 0.0, 0.0) == pytest.approx(0.75 * clear)
    assert par(0.0, 1.0, 0.0) == pytest.approx(0.02 * clear)
    assert par(0.0, 0.0, 0.2) == pytest.approx(0.8 * clear)


def test_wind_and_buoyancy_drive_the_vents() -> None:
    def flow(lee: float, wind_side: float, wind: float, difference: float) -> float:
        return float(through_vents(FloatNamespace, P, lee, wind_side, wind, difference))

    assert flow(0.0, 0.0, 8.0, 10.0) < 1e-6
    assert flow(0.5, 0.0, 8.0, 1.0) > 1.8 * flow(0.5, 0.0, 4.0, 1.0)
    assert flow(0.5, 0.5, 0.0, 16.0) == pytest.approx(2.0 * flow(0.5, 0.5, 0.0, 4.0), rel=0.01)
    assert flow(0.0, 1.0, 5.0, 1.0) > 2.0 * flow(1.0, 0.0, 5.0, 1.0)
    # Both sides half open at 4 m/s: some ten to forty air changes per hour.
    assert 10.0 < flow(0.5, 0.5, 4.0, 5.0) * 3600.0 / P.air_height < 40.0


def test_a_closed_screen_keeps_the_airs_apart() -> None:
    opened, closed = (past_screens(FloatNamespace, P, closure, 0.0, 6.0) for closure in (0.0, 1.0))
    assert opened > 50.0 * closed
    assert past_screens(FloatNamespace, P, 1.0, 1.0, 6.0) < closed


def test_leakage_is_a_few_tenths_of_an_air_change() -> None:
    assert 0.1 < leakage(FloatNamespace, P, 4.0) * 3600.0 / P.air_height < 0.8


def test_stomata_close_in_the_dark_and_transpiration_has_the_right_size() -> None:
    day = stomatal_resistance(FloatNamespace, P, 300.0, 800.0, 500.0, 1.0)
    night = stomatal_resistance(FloatNamespace, P, 0.0, 600.0, 300.0, 1.0)
    assert night > 3.0 * day
    assert stomatal_resistance(FloatNamespace, P, 300.0, 800.0, 500.0, 0.2) > 2.0 * day
    # A sunny hour, 1 kPa of deficit: 150 to 500 g m-2 h-1 (Stanghellini 1987, chapter 5).
    grams = vapour_conductance(P, 3.0, day) * 1000.0 / (461.5 * 295.0) * 3.6e6
    assert 150.0 < grams < 500.0


def test_photosynthesis_saturates_with_light_and_rises_with_co2() -> None:
    def gross(par: float, co2: float, temperature: float = 22.0) -> float:
        return float(photosynthesis(FloatNamespace, P, par, co2, temperature, 3.0)) * 1e6

    assert gross(0.0, 800.0) == 0.0
    assert gross(1200.0, 800.0) < 2.5 * gross(400.0, 800.0)
    assert 1.1 < gross(800.0, 1000.0) / gross(800.0, 400.0) < 1.8
    # A closed tomato canopy in full light and rich air: 30 to 60 umol m-2 s-1.
    assert 30.0 < gross(1000.0, 800.0) < 60.0
    assert gross(1200.0, 800.0, 42.0) < gross(1200.0, 800.0, 28.0)


def test_a_tomato_ripens_in_fifty_days_and_a_truss_comes_each_week() -> None:
    assert 1.0 / tomato.development_rate(20.0) / 86_400.0 == pytest.approx(51.6, abs=0.5)
    assert tomato.truss_rate(20.0) * 7 * 86_400.0 == pytest.approx(0.92, abs=0.05)


def test_fruits_appear_wait_and_are_harvested() -> None:
    crop, days = tomato.young_crop(P, 1.0)._replace(temperature_sum=0.0), 0
    while crop.harvested < 0.01 and days < 120:
        for _ in range(24):
            rate = tomato.rates(FloatNamespace, P, crop, 20.0)
            crop = tomato.grow(FloatNamespace, P, crop, rate, 0.0011, 20.0, 3600.0)
        days += 1
    assert 35 <= days <= 70
    assert np.all(crop.fruits >= 0.0)
    assert np.all(crop.fruit >= 0.0)


def test_deleafing_moves_carbohydrate_and_makes_none() -> None:
    crop = tomato.mature_crop(P, 1.0, leaf_area_index=4.0)
    picked = tomato.deleaf(FloatNamespace, P, crop)
    assert tomato.leaf_area_index(P, picked) == pytest.approx(P.leaf_area_maximum)
    assert tomato.stored_carbohydrate(picked) == pytest.approx(tomato.stored_carbohydrate(crop))


def test_elimination_agrees_with_numpy() -> None:
    rng = np.random.default_rng(0)
    matrix = rng.normal(size=(8, 8)) + 12.0 * np.eye(8)
    right = rng.normal(size=8)
    found = solve([list(row) for row in matrix], list(right))
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-12)


def test_a_clear_sky_is_cold() -> None:
    clear, covered = sky_temperature(10.0, 70.0, 0.0), sky_temperature(10.0, 70.0, 1.0)
    assert 8.0 < 10.0 - float(clear) < 22.0
    assert 10.0 - float(covered) < 4.0
