"""Plans are corrected by what the last days used and grew."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from igrow.core.planner.recent_use import (
    SCALED,
    Corrected,
    factors,
    grown_days,
    growth_of_days,
    totals,
    used_in,
    warmer,
)
from igrow.core.simulator.growth import GrowthBalance
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Crop, Greenhouse
from igrow.core.telemetry import Telemetry
from tests.planner.toy_greenhouse import START, ToySimulator
from tests.setpoint_tables import OPTIONAL


def days(*values: float) -> dict[str, np.ndarray]:
    return {name: np.array(values) for name in SCALED}


def test_a_simulator_that_was_right_is_left_alone_and_so_is_one_of_which_nothing_is_known() -> None:
    assert factors(days(2.0, 3.0), days(2.0, 3.0)) == dict.fromkeys(SCALED, 1.0)
    assert factors(days(), days()) == dict.fromkeys(SCALED, 1.0)
    assert factors(days(2.0), days(np.nan)) == dict.fromkeys(SCALED, 1.0)
    assert factors(days(0.0), days(0.0)) == dict.fromkeys(SCALED, 1.0)


def test_more_days_that_agree_bring_the_factor_nearer_to_what_they_show() -> None:
    one = factors(days(1.0), days(1.5))["heat"]
    three = factors(days(1.0, 1.0, 1.0), days(1.5, 1.5, 1.5))["heat"]
    assert 1.0 < one < three < 1.5
    assert factors(days(1.0, 5.0), days(1.5, np.nan))["heat"] == pytest.approx(one), "a day without a meter is no day"


def test_no_factor_is_beyond_belief() -> None:
    assert factors(days(0.01, 0.01), days(9.0, 9.0))["co2"] == 2.0
    assert factors(days(9.0, 9.0), days(0.01, 0.01))["co2"] == 0.5


def test_air_that_was_warmer_on_all_days_is_expected_to_be_so_again(weather) -> None:
    """A plan that the simulator takes for warm enough may be too cold for the crop in this greenhouse."""
    expected = np.array([18.0, 18.5, 19.0])
    assert -0.4 < warmer(expected, expected - 0.4) < -0.2
    assert warmer(expected, expected + np.array([0.3, -0.3, np.nan])) == pytest.approx(0.0)
    assert warmer(np.zeros(0), np.zeros(0)) == 0.0
    assert warmer(expected, expected + 20.0) == 1.0
    setpoints = np.tile([20.0, 600.0, 1.0, 0.5, *OPTIONAL], (1, 24, 1))
    plain = ToySimulator().simulate({}, weather[:24], setpoints, START)
    colder = Corrected(ToySimulator(), dict.fromkeys(SCALED, 1.0), warmer=-0.3).simulate(
        {}, weather[:24], setpoints, START
    )
    np.testing.assert_allclose(colder.air_temperature, plain.air_temperature - 0.3)
    np.testing.assert_array_equal(colder.net_growth, plain.net_growth)


def test_amounts_are_scaled_and_the_climate_is_not(weather) -> None:
    setpoints = np.tile([20.0, 600.0, 1.0, 0.5, *OPTIONAL], (2, 48, 1))
    plain = ToySimulator().simulate({}, weather, setpoints, START)
    factor = dict(zip(SCALED, (0.5, 1.0, 2.0), strict=True))
    scaled = Corrected(ToySimulator(), factor).simulate({}, weather, setpoints, START)
    np.testing.assert_array_equal(scaled.air_temperature, plain.air_temperature)
    before, after = totals(plain), totals(scaled)
    for name in SCALED:
        np.testing.assert_allclose(after[name], factor[name] * before[name])
    np.testing.assert_array_equal(scaled.net_growth, plain.net_growth)
    assert before["net_growth"].shape == (2,)


def test_growth_is_corrected_by_what_was_assimilated_and_not_by_a_factor(weather) -> None:
    """Twice the maintenance takes as much from a day with lamps as from one without: lamps stay worth what they add."""
    balance = GrowthBalance(0.6, 1e-4, np.diag([0.2, 2e-4]) ** 2)
    setpoints = np.tile([20.0, 600.0, 0.0, 0.5, *OPTIONAL], (2, 48, 1))
    setpoints[1, :, 2] = 1.0
    plain = ToySimulator(members=(1.0, 1.0, 1.0)).simulate({}, weather, setpoints, START)
    days = [first_day(plain, one) for one in range(2)]
    driven = [grown_days(balance, day) for day in days] * 3
    lost = 24 * 1e-4
    grown = [float(day.net_growth[0, 0].sum()) - lost for day in days] * 3
    fit = growth_of_days(replace(balance, covariance=balance.covariance * 100.0), Crop(), driven, grown)
    assert fit.conversion == pytest.approx(0.6, rel=0.02)
    assert fit.maintenance == pytest.approx(2e-4, rel=0.05)
    after = Corrected(ToySimulator(members=(1.0, 1.0, 1.0)), dict.fromkeys(SCALED, 1.0), balance, fit).simulate(
        {}, weather, setpoints, START
    )
    gain = [each.net_growth[0, 1].sum() - each.net_growth[0, 0].sum() for each in (plain, after)]
    assert gain[1] == pytest.approx(gain[0], rel=0.02)
    assert after.net_growth.sum(axis=-1).std(axis=0).min() > 0.0


def test_without_counted_growth_the_simulators_own_stays_with_its_doubt(weather) -> None:
    balance = GrowthBalance(0.6, 1e-4, np.diag([0.1, 1e-4]) ** 2)
    fit = growth_of_days(balance, Crop(), [(0.02, 24.0)], [float("nan")])
    assert (fit.conversion, fit.maintenance) == (0.6, 1e-4)
    assert "counts no growth" in fit.sentence


def first_day(outcome, candidate):
    return Outcome(**{one.name: getattr(outcome, one.name)[:, [candidate], :24] for one in fields(Outcome)})


def test_a_log_tells_what_was_used() -> None:
    time = START + np.arange(288) * np.timedelta64(300, "s")
    log = Telemetry(
        time,
        {
            "air_temperature": np.full(288, 20.0),
            "rail_pipe_temperature": np.full(288, 40.0),
            "lamp_power": np.full(288, 50.0),
            "co2_dosing": np.where(np.arange(288) == 7, np.nan, 0.002),
            "net_growth": 1.0 + 0.01 * np.arange(288) / 288,
        },
    )
    greenhouse = Greenhouse()
    used = used_in(log, greenhouse)
    assert used["heat"] == pytest.approx(greenhouse.rail_pipe_heat_transfer * 20.0 * 86_400 / 1e6)
    assert used["electricity"] == pytest.approx(1.2)
    assert used["co2"] == pytest.approx(0.048)
    assert used["net_growth"] == pytest.approx(0.01)


def test_what_a_log_does_not_tell_is_not_guessed() -> None:
    time = START + np.arange(25) * np.timedelta64(3600, "s")
    used = used_in(Telemetry(time, {"air_temperature": np.full(25, 20.0)}), Greenhouse())
    assert np.isnan(list(used.values())).all()
    assert np.isnan(list(used_in(Telemetry(time[:0], {}), Greenhouse()).values())).all()
