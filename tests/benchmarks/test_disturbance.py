"""The disturbance state of the hybrid stage."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.forecasts.disturbance import (
    CHANNELS,
    DisturbanceModel,
    expected_fluxes,
    helpful_channels,
    missing_fluxes,
)
from igrow.core.simulator.hybrid.nominal import site_record
from tests.virtual_log import GREENHOUSE, SITE, virtual_log

DAY = 288


@pytest.fixture(scope="module")
def parameters() -> dict[str, float]:
    return GREENHOUSE


def test_a_flux_that_the_balances_lack_is_seen_in_its_size_and_channel(parameters: dict[str, float]) -> None:
    count = 4 * DAY
    log = virtual_log(4, added={"heat": np.full(count, 20.0)}, noise=False)
    missing = missing_fluxes(site_record(log, SITE, 300.0), parameters, {})
    settled = slice(DAY, count - 1)
    assert np.nanmean(missing["heat"][settled]) == pytest.approx(20.0, abs=3.0)
    assert abs(np.nanmean(missing["co2"][settled])) < 2e-8


def test_nothing_is_missing_where_the_plant_is_the_model(parameters: dict[str, float]) -> None:
    missing = missing_fluxes(site_record(virtual_log(3, noise=False), SITE, 300.0), parameters, {})
    assert np.nanmean(np.abs(missing["heat"][DAY:])) < 3.0


def test_a_forecast_uses_nothing_after_its_start(parameters: dict[str, float]) -> None:
    log = virtual_log(5)
    record = site_record(log, SITE, 300.0)
    missing = missing_fluxes(record, parameters, {})
    start = 3 * DAY + 100
    changed = {channel: np.where(np.arange(len(flux)) >= start, 1e6, flux) for channel, flux in missing.items()}
    model = DisturbanceModel()
    known = expected_fluxes(record, missing, [start], 2 * DAY, model)
    blind = expected_fluxes(record, changed, [start], 2 * DAY, model)
    for channel, flux in known.items():
        np.testing.assert_array_equal(flux, blind[channel])


def test_what_was_missing_at_an_hour_is_expected_again_at_that_hour(parameters: dict[str, float]) -> None:
    count = 6 * DAY
    noon = ((np.arange(count) // 12) % 24 >= 10) & ((np.arange(count) // 12) % 24 < 14)
    log = virtual_log(6, added={"heat": np.where(noon, -40.0, 0.0)}, noise=False)
    record = site_record(log, SITE, 300.0)
    missing = missing_fluxes(record, parameters, {})
    expected = expected_fluxes(record, missing, [5 * DAY - 1], DAY, DisturbanceModel())["heat"][:, 0]
    hour = ((5 * DAY - 1 + np.arange(DAY)) // 12) % 24
    assert expected[hour == 12].mean() < -20.0
    assert abs(expected[hour == 2].mean()) < 5.0


def test_a_channel_whose_expectation_makes_a_quantity_worse_is_left_out(parameters: dict[str, float]) -> None:
    def errors_with(channels: frozenset[str]) -> dict[str, float]:
        errors = {"air_temperature": 1.0, "air_humidity": 1.0, "air_co2": 1.0}
        errors["air_temperature"] -= 0.4 * ("heat" in channels)
        errors["air_humidity"] += 1.0 * ("vapour" in channels) - 0.1 * ("heat" in channels)
        errors["air_co2"] -= 0.2 * ("co2" in channels)
        return errors

    chosen = helpful_channels(errors_with)
    assert chosen == {"heat", "co2"}
    record = site_record(virtual_log(4), SITE, 300.0)
    expected = expected_fluxes(
        record, missing_fluxes(record, parameters, {}), [3 * DAY], DAY, DisturbanceModel().restricted(chosen)
    )
    assert [channel for channel in CHANNELS if np.any(expected[channel])] == ["heat", "co2"]


def test_where_nothing_helps_nothing_is_expected() -> None:
    assert helpful_channels(lambda channels: {"air_temperature": 1.0 + 0.1 * len(channels)}) == frozenset()
