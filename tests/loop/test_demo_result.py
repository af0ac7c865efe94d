"""What the demo says of money: each day stands with the bundle that planned it."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest

from igrow.core.site import load_site
from igrow.core.telemetry import Telemetry

DEMO = Path(__file__).parents[2] / "config/demo"
DAY = np.timedelta64(1, "D")
START = np.datetime64("2020-02-01T00:00:00", "s")
DAYS, ADOPTED = 6, 3


@pytest.fixture(scope="module")
def result():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DEMO))
        yield importlib.import_module("result")


def log(co2: float = 0.002) -> Telemetry:
    """Return a greenhouse that is all the same but grows more each day."""
    rows = DAYS * 288
    steady = {
        "air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 700.0, "leaf_area_index": 3.0, "lamp_power": 0.0,
        "rail_pipe_temperature": 20.0, "grow_pipe_temperature": 20.0, "fruit_fresh_weight": 0.0, "co2_dosing": co2,
    }  # fmt: skip
    growth = np.cumsum(np.repeat(0.002 * (1 + np.arange(DAYS)), 288) / 288)
    columns = {name: np.full(rows, value) for name, value in steady.items()} | {"net_growth": growth}
    return Telemetry(START + np.arange(rows) * np.timedelta64(300, "s"), columns)


def events(co2: float = 5.0):
    return [
        {
            "kind": "plan", "start": f"{(START + day * DAY).astype(object).isoformat()}+00:00", "co2_before": co2,
            "expected_profit": float(day), "recipe_profit": 0.5 * day,
        }
        for day in range(1, DAYS)
    ]  # fmt: skip


def test_the_first_day_under_a_bundle_is_told_as_its_own(result):
    site = load_site(DEMO / "site.yaml")
    money = result.compare_money(site, log(), log(), events(), ADOPTED)
    assert [(row["days"], row["plan_expected"], row["recipe_expected"]) for row in money.values()] == [
        (2, 1.5, 0.75),
        (3, 4.0, 2.0),
    ]
    grown = {name: row["plan_obtained"] for name, row in money.items()}
    assert grown["corrected bundle"] > grown["first bundle"]
    assert money["corrected bundle"]["gain_obtained"] == money["corrected bundle"]["gain_standard_error"] == 0.0
    assert result.compare_money(site, log(), log(), [], ADOPTED) == {}


def test_co2_costs_what_the_tier_says_that_the_crop_has_reached(result):
    site = load_site(DEMO / "site.yaml")
    cheap, dear = (
        result.compare_money(site, log(), log(), events(co2), ADOPTED)["first bundle"]["plan_obtained"]
        for co2 in (5.0, 15.0)
    )
    assert cheap - dear == pytest.approx(0.002 * 24 * (0.20 - 0.08))
