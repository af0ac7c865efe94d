"""A plan explained: what each change is for, in money, and which limits stood in the way."""

from __future__ import annotations

from dataclasses import replace
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.planner import Budget, optimise
from igrow.core.planner.explain import PARTS, explain, limits_in_force
from tests.planner.toy_greenhouse import ToySimulator

QUICK = Budget(candidates=4_800)


@pytest.fixture
def planned(site, state, weather, recipe):
    simulator = ToySimulator(members=(0.8, 1.0, 1.2))
    result = optimise(simulator, site, state, weather, recipe, np.random.default_rng(2), QUICK)
    return simulator, result, explain(simulator, state, weather, result)


def test_the_balance_is_that_of_plan_and_recipe(planned) -> None:
    _, result, told = planned
    assert told.plan["profit"].mean == pytest.approx(result.expected_profit)
    assert told.recipe["profit"].mean == pytest.approx(result.recipe_profit)
    assert told.gain.mean == pytest.approx(result.expected_profit - result.recipe_profit)
    assert told.gain.interval[0] < told.gain.mean < told.gain.interval[1]


def test_of_a_search_that_looked_further_only_the_plan_s_own_hours_are_told(planned, state, weather) -> None:
    """The day after the plan was searched too, since what it bears hangs on the plan; it is another plan's."""
    simulator, result, whole = planned
    told = explain(simulator, state, weather, result, 24)
    assert (told.plan["profit"].mean, told.recipe["profit"].mean) == pytest.approx(result.profits(24))
    assert told.plan["profit"].mean != pytest.approx(whole.plan["profit"].mean)
    end = float(state.time.astype("datetime64[s]").astype(np.int64)) + 86_400.0
    assert told.changes
    assert all(change.start < end for change in told.changes)


def test_each_change_is_told_with_what_it_earns_and_costs(planned) -> None:
    _, _, told = planned
    assert told.changes
    for change in told.changes:
        earned = change.parts["income"] - sum(change.parts[name] for name in PARTS if name != "income")
        assert earned == pytest.approx(change.gain.mean, abs=1e-9)
        assert change.end > change.start
    lamps = [one for one in told.changes if one.setpoint == "lamp_on"]
    assert lamps, "a search on the toy buys or saves light"
    more = [one for one in lamps if one.plan > one.recipe]
    assert all(one.parts["electricity"] > 0 and one.parts["income"] > 0 for one in more)
    sentence = told.changes[0].sentence(ZoneInfo("Europe/Amsterdam"))
    assert "instead of" in sentence and "gain" in sentence


def test_a_plan_that_is_the_recipe_has_no_changes(site, state, weather, planned) -> None:
    simulator, result, _ = planned
    same = replace(result, setpoints=result.recipe, outcome=result.recipe_outcome)
    told = explain(simulator, state, weather, same)
    assert told.changes == ()
    assert told.gain.mean == 0.0


def test_limits_are_told_by_the_stretch_in_which_they_bind() -> None:
    binding = {"lamp_on": (("dark_hours",), ("dark_hours",), (), ("dark_hours", "rest"), ("rest",))}
    assert list(limits_in_force(binding)) == [
        ("lamp_on", "dark_hours", 0, 1),
        ("lamp_on", "dark_hours", 3, 3),
        ("lamp_on", "rest", 3, 4),
    ]
