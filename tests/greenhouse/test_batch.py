"""A batch on arrays and a single greenhouse on floats are the same plant."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.core.greenhouse import Disturbances, GreenhouseParameters, HiddenEffect, recipe, simulate, simulate_many
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.parameters import KNOWN
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.telemetry import Telemetry
from tests.greenhouse.greenhouse_seasons import SPRING, hours


@pytest.mark.slow
def test_each_of_a_batch_runs_as_it_would_alone(spring: Telemetry) -> None:
    rng = np.random.default_rng(4)
    parameters = [GreenhouseParameters().varied(rng) for _ in range(3)]
    effects = [
        [HiddenEffect("wind_infiltration", 0.2)],
        [],
        [HiddenEffect("soil_heat_storage"), HiddenEffect("co2_drift")],
    ]
    end = SPRING + hours(18)
    together = simulate_many(
        parameters, spring, recipe, SPRING, end, count=3, seed=1, effects=effects, disturbances=QUIET, sensors=EXACT
    )
    for one, own, batch in zip(parameters, effects, together, strict=True):
        alone = simulate(one, spring, recipe, SPRING, end, seed=1, effects=own, disturbances=QUIET, sensors=EXACT)
        for name, values in alone.measured.columns.items():
            np.testing.assert_allclose(batch.measured[name], values, rtol=1e-7, atol=1e-7, err_msg=name)
        assert batch.total("heat") == pytest.approx(alone.total("heat"), rel=1e-9)


def test_a_batch_of_one_is_the_greenhouse_alone_and_goes_on_from_its_crop(spring: Telemetry) -> None:
    own, plant, end = [HiddenEffect("wind_infiltration", 0.2)], GreenhouseParameters(), SPRING + hours(6)
    alone = simulate(plant, spring, recipe, SPRING, end, seed=1, effects=own)
    (one,) = simulate_many([plant], [spring], recipe, SPRING, end, count=1, seed=1, effects=[own])
    for name, values in alone.measured.columns.items():
        np.testing.assert_array_equal(one.measured[name], values, err_msg=name)
    assert one.crop.fruit.shape == (len(alone.crop.fruit), 1) and one.crop.leaf == pytest.approx([alone.crop.leaf])
    later = {
        "alone": simulate(plant, spring, recipe, end, end + hours(3), seed=1, crop=alone.crop),
        "one": simulate_many(plant, spring, recipe, end, end + hours(3), count=1, seed=1, crop=one.crop)[0],
    }
    assert later["one"].total("heat") == later["alone"].total("heat")
    with pytest.raises(IgrowError, match="one of each, not 2"):
        simulate_many(plant, [spring, spring], recipe, SPRING, end, count=1, seed=1)


def test_each_of_a_batch_may_have_its_own_weather_and_setpoints(winter: Telemetry, spring: Telemetry) -> None:
    shifted = Telemetry(spring.time, {name: winter[name] for name in spring.columns})
    cold = Telemetry(spring.time[:1], {"heating_setpoint": np.array([15.0])})
    warm = Telemetry(spring.time[:1], {"heating_setpoint": np.array([22.0])})
    first, second = simulate_many(
        GreenhouseParameters(), [spring, shifted], [cold, warm], SPRING, SPRING + hours(12), count=2, seed=1
    )
    assert second.total("heat") > first.total("heat") + 1.0
    np.testing.assert_allclose(second.true["wind_speed"], winter["wind_speed"][: len(second.true)], atol=1e-9)
    assert (first.true["heating_setpoint"][-1], second.true["heating_setpoint"][-1]) == (15.0, 22.0)
    assert not np.allclose(first.true["wind_speed"], second.true["wind_speed"])


@pytest.mark.slow
def test_each_of_a_batch_may_have_its_own_disturbances(spring: Telemetry) -> None:
    end = SPRING + hours(48)
    each = [QUIET, Disturbances(), replace(Disturbances(), heat=12.0, correlation_hours=8.0)]
    seasons = simulate_many(
        GreenhouseParameters(), spring, recipe, SPRING, end, count=3, seed=1, disturbances=each, sensors=EXACT
    )
    plain = simulate(GreenhouseParameters(), spring, recipe, SPRING, end, seed=1, disturbances=QUIET, sensors=EXACT)
    away = [np.std(one.true["air_temperature"] - plain.true["air_temperature"]) for one in seasons]
    assert away[0] < 1e-6
    assert 0.02 < away[1] < 0.5 * away[2]


def test_a_list_of_the_wrong_length_is_refused(spring: Telemetry) -> None:
    with pytest.raises(IgrowError, match="3 greenhouses needs 3 sets"):
        simulate_many([GreenhouseParameters()], spring, recipe, SPRING, SPRING + hours(1), count=3, seed=1)
    with pytest.raises(IgrowError, match="2 greenhouses needs 2 disturbances"):
        simulate_many(
            GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(1), count=2, seed=1, disturbances=[QUIET]
        )
    with pytest.raises(IgrowError, match="one list each"):
        simulate_many(
            GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(1), count=3, seed=1, effects=[[], []]
        )


def test_varied_parameters_are_off_by_the_asked_size_and_known_ones_not_at_all() -> None:
    rng = np.random.default_rng(0)
    base = GreenhouseParameters()
    factors = [np.log(base.varied(rng, 0.08).air_height / base.air_height) for _ in range(400)]
    assert np.std(factors) == pytest.approx(0.08, rel=0.15)
    varied = base.varied(rng)
    assert all(getattr(varied, name) == getattr(base, name) for name in KNOWN)
    assert varied.cover_transmission <= 0.98


@pytest.mark.soak
def test_one_step_of_one_greenhouse_costs_at_most_two_milliseconds(spring: Telemetry) -> None:
    start = time.process_time()
    simulate(GreenhouseParameters(), spring, recipe, SPRING, SPRING + hours(96), seed=1)
    assert (time.process_time() - start) / (96 * 12) < 2e-3
