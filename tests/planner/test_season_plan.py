"""What a season leaves to its days: it survives being written, fits the crop that was counted, and ends in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.bundle import BundleError
from igrow.core.greenhouse import GreenhouseParameters, tomato
from igrow.core.planner import Budget, PlanningState, optimise
from igrow.core.planner.optimise import NOT_ADMITTED
from igrow.core.planner.season import Season, SeasonPlan, Strategy, run_season, valued
from igrow.core.planner.season.course import bearable_damp
from igrow.core.planner.season.search import SETTINGS, genetic, worth_of
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Site
from tests.planner.toy_greenhouse import ToySimulator

PLANT = GreenhouseParameters()
START = np.datetime64("2020-01-31T23:00:00", "s")
DAY = np.timedelta64(86_400, "s")
DAYS = 40


@pytest.fixture
def season(site: Site, weather: np.ndarray, recipe: np.ndarray) -> Season:
    """Forty days of which each ten are like one, in a toy greenhouse."""
    return Season(site, ToySimulator(), PLANT, START, DAYS, np.stack([weather[:24]] * 4), 10, recipe[:24])


@pytest.fixture
def plan(season: Season) -> SeasonPlan:
    strategy = Strategy(DAYS, 2)
    genes = np.full(strategy.genes, 0.5, dtype=np.float32)
    return valued(season, strategy, genes, tomato.mature_crop(PLANT, 1.0))


def test_a_season_survives_being_written(plan: SeasonPlan, site: Site) -> None:
    again = SeasonPlan.from_json(plan.to_json(), "season.json")
    assert (again.start, again.days, again.every, again.knots) == (START, DAYS, 10, 2)
    time = START + 12 * DAY
    for one in (plan, again):
        assert one.worth(site, time, {}) is not None
    np.testing.assert_allclose(again.values[1].fruit, plan.values[1].fruit)
    assert again.numbers(time) == pytest.approx(plan.numbers(time), abs=1e-3)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: "{", "is no season"),
        (lambda text: text.replace('"format": 1', '"format": 99'), "format 99"),
        (lambda text: text.replace('"knots": 2', '"knots": 3'), "do not fit"),
        (lambda text: text.replace('"every"', '"each"'), "is no season"),
    ],
)
def test_what_is_no_season_is_refused_in_one_line(plan: SeasonPlan, change, reason: str) -> None:
    with pytest.raises(BundleError, match=reason):
        SeasonPlan.from_json(change(plan.to_json()), "season.json")


def test_outside_of_the_season_nothing_is_said(plan: SeasonPlan, site: Site) -> None:
    assert plan.worth(site, START - DAY, {}) is None
    assert plan.worth(site, START + DAYS * DAY, {}) is None


def test_the_crop_is_the_one_that_was_counted(plan: SeasonPlan, site: Site) -> None:
    """Half the leaves and two thirds of the fruit are there; a load of nothing at all is a grower's typing error."""
    expected = plan.worth(site, START, {})
    assert expected is not None
    load = float(expected.crop.fruits.sum())
    counted = plan.worth(site, START, {"leaf_area_index": 1.5, "plant_load": load * 2 / 3}, warmth=16.0)
    assert counted is not None
    assert float(counted.crop.leaf) * counted.plant.specific_leaf_area == pytest.approx(1.5)
    assert float(counted.crop.fruits.sum()) == pytest.approx(load * 2 / 3)
    assert float(counted.crop.mean_temperature) == 16.0
    odd = plan.worth(site, START, {"plant_load": 1e-6})
    assert odd is not None
    assert float(odd.crop.fruits.sum()) == pytest.approx(load / 3)


def test_young_fruit_is_worth_the_less_the_nearer_the_end(plan: SeasonPlan) -> None:
    young = [one.fruit[0] for one in plan.values]
    assert young[0] > 0.0
    assert young[-1] < 0.2 * max(young)
    assert plan.values[-1].fruit[-1] > young[-1]


def test_a_day_is_searched_by_the_season_s_values(
    plan: SeasonPlan, site: Site, weather: np.ndarray, recipe: np.ndarray
) -> None:
    """Light that grows fruit which no day ripens any more is not bought; by an average price it is."""
    state = PlanningState(START + (DAYS - 4) * DAY, {})
    worth = plan.worth(site, state.time, {})
    assert worth is not None
    hopeless = replace(worth, values=replace(worth.values, buffer=0.0, leaf=0.0, fruit=0.0 * worth.values.fruit))
    budget = Budget(candidates=3_840)
    lamps = []
    for one in (None, hopeless):
        found = optimise(
            ToySimulator(), site, state, weather[:24], recipe[:24], np.random.default_rng(0), budget, worth=one
        )
        lamps.append(found.setpoints[:, 2].sum())
        assert found.profits(24) == pytest.approx((found.expected_profit, found.recipe_profit))
    assert lamps[1] < lamps[0]


def test_the_first_candidate_of_a_day_is_what_the_season_asks_of_it(
    plan: SeasonPlan, site: Site, weather: np.ndarray, recipe: np.ndarray
) -> None:
    """Its day and its night, warmer by the sun that is expected, and the recipe where it says nothing."""
    time = START + 5 * DAY
    template = for_site(site, time, 48, radiation=weather[:48, 3])
    asked = plan.setpoints(template, weather[:48], recipe[:48], time)
    assert asked.shape == (48, len(SETPOINTS))
    numbers = plan.numbers(time)
    warm = numbers["day_temperature"] + numbers["warmer_by_sun"] * weather[:24, 3].mean() / 100.0
    assert asked[:24, 0].max() == pytest.approx(warm)
    assert asked[:24, 0].min() == pytest.approx(numbers["night_temperature"])
    np.testing.assert_array_equal(asked[:, 3], recipe[:48, 3])


def test_the_search_of_a_season_finds_more_than_its_first_generation(season: Season) -> None:
    strategy = Strategy(DAYS, 1)
    value = worth_of(season, strategy, tomato.mature_crop(PLANT, 1.0))
    genes, history = genetic(value, strategy.genes, 6, 1)
    assert len(history) == 6
    assert history[-1] > history[0]
    assert value(genes[None])[0] == pytest.approx(history[-1], rel=1e-5)
    assert SETTINGS.offspring == 48


def test_usual_weather_is_between_the_cold_and_the_mild_day_of_a_date(plan: SeasonPlan) -> None:
    warmth = np.arange(4.0)[:, None, None] * np.ones((24, 6))
    usual = replace(plan, weather=warmth).typical_weather(START + 9 * DAY, 48)
    np.testing.assert_allclose(usual[[0, 47], 0], 0.5)
    np.testing.assert_allclose(replace(plan, weather=warmth).typical_weather(START + 39 * DAY, 24)[:, 0], 2.5)


def damp(season: Season) -> Season:
    """The season of a site whose plans choose a humidity setpoint."""
    site = season.site
    chosen = replace(site.planning, optimise=(*site.planning.optimise, "humidity_setpoint"))
    named = replace(site, setpoints=SETPOINTS, planning=chosen)
    return replace(season, site=named, simulator=ToySimulator(setpoints=SETPOINTS))


def test_a_strategy_says_a_humidity_where_the_computer_takes_one(season: Season, recipe: np.ndarray) -> None:
    strategy, column = Strategy(DAYS, 2, optional=("humidity_setpoint",)), SETPOINTS.index("humidity_setpoint")
    assert strategy.genes == Strategy(DAYS, 2).genes + 2
    genes = np.full(strategy.genes, 0.5, dtype=np.float32)
    plan = valued(damp(season), strategy, genes, tomato.mature_crop(PLANT, 1.0))
    again = SeasonPlan.from_json(plan.to_json(), "season.json")
    assert again.numbers(START)["humidity"] == pytest.approx(82.5)
    takes, lacks = (for_site(one.site, START, 48, known=one.simulator.setpoints) for one in (damp(season), season))
    weather = np.tile(season.weather[0], (2, 1))
    assert again.setpoints(takes, weather, recipe, START)[:, column] == pytest.approx(82.5)
    # A site that has given it up since keeps its recipe.
    assert (again.setpoints(lacks, weather, recipe, START)[:, column] == recipe[:, column]).all()


def test_a_season_without_a_humidity_is_written_as_before_it_was_known(plan: SeasonPlan) -> None:
    assert "optional" not in plan.to_json()


def test_a_strategy_that_says_the_humidity_is_read_as_it_was_written_at_first(season: Season) -> None:
    strategy = Strategy(DAYS, 2, optional=("humidity_setpoint",))
    genes = np.full(strategy.genes, 0.5, dtype=np.float32)
    text = valued(damp(season), strategy, genes, tomato.mature_crop(PLANT, 1.0)).to_json()
    before = text.replace('"optional": ["humidity_setpoint"]', '"humidity": true')
    assert before != text
    assert SeasonPlan.from_json(before, "season.json").optional == ("humidity_setpoint",)
    unknown = text.replace('"optional": ["humidity_setpoint"]', '"optional": ["fog_setpoint"]')
    with pytest.raises(BundleError, match="says fog_setpoint, which this version does not know"):
        SeasonPlan.from_json(unknown, "season.json")


def test_a_strategy_has_vents_open_so_far_above_the_heating(season: Season, recipe: np.ndarray) -> None:
    strategy = Strategy(DAYS, 1, optional=("ventilation_setpoint",))
    genes = np.full((1, strategy.genes), 0.5, dtype=np.float32)
    asked = strategy.setpoints(genes, 0.0, np.arange(24.0), np.arange(24) > 11, season.weather[0], recipe[:24])[0]
    heating, vents = (asked[:, SETPOINTS.index(f"{name}_setpoint")] for name in ("heating", "ventilation"))
    assert vents - heating == pytest.approx(np.full(24, 3.5))
    assert np.ptp(heating) > 0.5


def test_a_strategy_that_leaves_days_damper_than_the_crop_bears_is_not_admitted(season: Season) -> None:
    one = damp(season)
    # Where the toy's recipe holds 85 %, a crop that bears 86 is never damp under it.
    site = replace(one.site, crop=replace(one.site.crop, humidity_high=86.0))
    strategy, crop = Strategy(DAYS, 1, optional=("humidity_setpoint",)), tomato.mature_crop(PLANT, 1.0)
    genes = np.full((2, strategy.genes), 0.5, dtype=np.float32)
    genes[:, -1] = (0.2, 0.9)
    season = replace(one, site=site)
    drier, damper = worth_of(season, strategy, crop)(genes)
    outcome = run_season(season, strategy, genes[:1], crop)
    assert drier == pytest.approx(outcome.balance.net_profit[0] - outcome.penalty[0])
    # All hours of its four typical days are damp, twelve of each beyond what the crop bears.
    assert damper == pytest.approx(NOT_ADMITTED * (1.0 + 4 * 12.0))


def test_a_strategy_may_leave_days_as_damp_as_the_recipe_does(season: Season) -> None:
    one = damp(season)
    assert bearable_damp(one) == pytest.approx(np.full(4, one.site.crop.agronomy.damp_hours))
    site = replace(one.site, crop=replace(one.site.crop, humidity_high=60.0))
    assert bearable_damp(replace(one, site=site)) == pytest.approx(np.full(4, 24.0))
