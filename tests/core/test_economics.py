"""Money by the challenge's rules: prices, tiers, tariffs, and the six teams' balances from their files."""

from __future__ import annotations

import csv
import datetime
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from igrow.core.economics import (
    Balance,
    co2_cost,
    electricity_price,
    harvest_income,
    is_peak,
    product_price,
    running_costs,
)
from igrow.core.site import ElectricityTariff, Prices, Tier

PRICES = Prices()


@pytest.mark.parametrize(
    ("day", "brix", "price"),
    [
        ("2020-01-01", 10, 5.0),
        ("2020-01-14", 6, 3.0),
        ("2020-02-12", 8, 3.5),
        ("2020-06-17", 10, 2.5),
        ("2019-12-20", 6, 3.0),
        ("2021-01-01", 6, 1.1),
    ],
)
def test_the_product_price_is_linear_in_brix_and_holds_beyond_its_table(day: str, brix: float, price: float) -> None:
    assert product_price(PRICES, np.array([day], dtype="datetime64[s]"), brix)[0] == pytest.approx(price)


def test_peak_hours_are_local_and_follow_the_clock_change() -> None:
    time = np.array(["2020-01-15T05:59", "2020-01-15T06:00", "2020-07-15T05:00", "2020-01-15T22:00"], "datetime64[s]")
    np.testing.assert_array_equal(electricity_price(PRICES, time, "Europe/Amsterdam"), [0.04, 0.08, 0.08, 0.04])


def test_peak_hours_may_run_over_midnight() -> None:
    tariff = ElectricityTariff(peak_start=datetime.time(22), peak_end=datetime.time(2))
    hours = is_peak(replace(PRICES, electricity=tariff), [21.9, 22.0, 1.9, 2.0])
    np.testing.assert_array_equal(hours, [False, True, True, False])


def test_co2_above_twelve_kilogrammes_costs_the_second_tier() -> None:
    assert co2_cost(PRICES, 0.0, 12.5) == pytest.approx(0.08 * 12 + 0.20 * 0.5)
    assert co2_cost(PRICES, 13.0, 1.0) == pytest.approx(0.20)


@given(st.lists(st.floats(0, 5), min_size=1, max_size=20), st.floats(0.01, 30))
def test_co2_costs_the_same_in_one_piece_as_day_by_day(days: list[float], edge: float) -> None:
    prices = replace(PRICES, co2=(Tier(0.1, edge), Tier(0.3, edge * 2), Tier(0.05)))
    before = np.concatenate([[0.0], np.cumsum(days)[:-1]])
    assert co2_cost(prices, before, np.array(days)).sum() == pytest.approx(float(co2_cost(prices, 0.0, sum(days))))


def test_running_costs_are_summed_over_hours_for_each_candidate() -> None:
    time = np.datetime64("2020-01-15T00:00:00") + np.arange(24) * np.timedelta64(1, "h")
    heat = np.stack([np.full(24, 1.0), np.zeros(24)])
    electricity = np.stack([np.full(24, 0.1), np.zeros(24)])
    co2 = np.stack([np.full(24, 0.5), np.zeros(24)])
    balance = running_costs(PRICES, "UTC", time, heat, electricity, co2, 3.0, co2_before=6.0)
    np.testing.assert_allclose(balance.heat, [24 * 0.0083, 0.0])
    np.testing.assert_allclose(balance.electricity, [0.1 * (16 * 0.08 + 8 * 0.04), 0.0])
    np.testing.assert_allclose(balance.co2, [6 * 0.08 + 6 * 0.20, 0.0])
    np.testing.assert_allclose(balance.net_profit, -balance.costs)
    np.testing.assert_allclose(balance.upkeep, 3 * 0.0085)


def columns(path: Path) -> list[np.ndarray]:
    """Return the columns of a challenge file by position: its headers have stray tabs and too few commas."""
    with path.open() as file:
        rows = list(csv.reader(file))[1:]
    width = min(len(row) for row in rows)
    return [np.array([float(row[i]) if row[i].strip() else np.nan for row in rows]) for i in range(width)]


def days(serial: np.ndarray) -> np.ndarray:
    return np.asarray(np.datetime64("1899-12-30") + np.floor(serial).astype(int))


# From the table of computed totals beside the data, EUR/m2; the Reference counts its first harvest as of 2020.
TEAMS = {
    "Automatoes": (36.49, 4.29, 6.60, 17.04, 1.54, 0.73, 6.30),
    "AICU": (34.83, 3.96, 5.64, 16.38, 2.09, 0.81, 5.94),
    "Reference": (35.28, 3.08, 7.17, 16.87, 3.91, 0.69, 3.55),
    "IUACAAS": (32.87, 4.29, 6.28, 15.60, 2.78, 0.58, 3.34),
    "Digilog": (34.42, 2.86, 5.59, 20.57, 1.44, 0.77, 3.19),
    "TheAutomators": (36.22, 3.96, 6.89, 18.48, 3.01, 1.06, 2.82),
}


@pytest.mark.parametrize("team", TEAMS)
def test_the_balance_of_a_challenge_team_follows_from_its_files(team: str, data_folder: Path) -> None:
    folder = data_folder / "agc2019" / team
    production, resources = columns(folder / "Production.csv"), columns(folder / "Resources.csv")
    crop, quality = columns(folder / "CropParameters.csv"), columns(folder / "TomQuality.csv")
    harvest = np.where(production[0] == 43510, 43875, production[0])  # its first row bears the wrong year
    measured = np.flatnonzero(~np.isnan(crop[4]))
    held = np.clip(np.searchsorted(crop[0][measured], resources[0], side="right") - 1, 0, None)
    brix = np.interp(harvest, quality[0], quality[2])
    income = harvest_income(PRICES, days(harvest), production[1], production[2], brix)
    heat, peak, off_peak, co2 = (np.nansum(resources[column]) for column in range(1, 5))
    balance = Balance(
        income=np.asarray(np.nansum(income)),
        plants=np.asarray(PRICES.plant * crop[5][0]),
        upkeep=PRICES.stem_day * np.nansum(crop[4][measured][held]),
        electricity=PRICES.electricity.peak * peak + PRICES.electricity.off_peak * off_peak,
        heat=PRICES.heat * heat,
        co2=co2_cost(PRICES, 0.0, co2),
    )
    found = (balance.income, balance.plants, balance.upkeep, balance.electricity, balance.heat, balance.co2)
    np.testing.assert_allclose([*found, balance.net_profit], TEAMS[team], atol=0.011)
