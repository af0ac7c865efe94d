"""A season: strategies in a grower's words, a crop that lives through it, and what its state is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from igrow.core.agronomy import Place
from igrow.core.agronomy.inspection import violations
from igrow.core.greenhouse import GreenhouseParameters, tomato
from igrow.core.planner import Objective
from igrow.core.planner.season import CropWorth, Season, Strategy, marginal_values, run_season
from igrow.core.planner.season.course import asked
from igrow.core.planner.season.crop import fresh, like, live, supplied
from igrow.core.planner.season.strategy import RANGES
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.site import Site
from tests.planner.toy_greenhouse import ToySimulator

PLANT = GreenhouseParameters()
START = np.datetime64("2020-01-31T23:00:00", "s")
DAYS = 40


@pytest.fixture
def season(site: Site, weather: np.ndarray, recipe: np.ndarray) -> Season:
    """Forty days of which each ten are like one, in a toy greenhouse."""
    return Season(site, ToySimulator(), PLANT, START, DAYS, np.stack([weather[:24]] * 4), 10, recipe[:24])


def genes_of(strategy: Strategy, **numbers: float) -> np.ndarray:
    """Return the genes (1, G) of a strategy that says the same at all its dates."""
    shares = []
    for name, (low, high) in RANGES.items():
        value = numbers.get(name, 0.5 * (low + high))
        shares += [(value - low) / (high - low)] * strategy.knots
    return np.array([shares + [1.0] * strategy.ends], dtype=np.float32)


def test_between_two_dates_numbers_lie_on_a_straight_line() -> None:
    strategy = Strategy(101, 3)
    genes = np.zeros((1, strategy.genes), dtype=np.float32)
    genes[0, 1] = 1.0
    low, high = RANGES["day_temperature"]
    said = [strategy.numbers(genes, day)["day_temperature"][0] for day in (0, 25, 50, 75, 100, 400)]
    np.testing.assert_allclose(said, [low, (low + high) / 2, high, (low + high) / 2, low, low])
    assert len(strategy.table(genes[0])) == 1 + 8


def test_a_rule_is_a_strategy_of_one_date_and_a_day_from_which_lamps_stay_off() -> None:
    rule = Strategy(100, 1, ends=True)
    genes = genes_of(rule, lamp_hours=12.0)
    genes[0, -1] = 0.6
    assert [float(rule.numbers(genes, day)["lamp_hours"][0]) for day in (0, 59, 61)] == pytest.approx([12, 12, 0])


def test_a_strategy_says_what_a_grower_would(season: Season, weather: np.ndarray) -> None:
    strategy = Strategy(DAYS, 1)
    genes = genes_of(strategy, day_temperature=20.0, night_temperature=17.0, warmer_by_sun=1.0, co2=800.0,
                     lamp_hours=12.0, lamps_from=1.9, lamps_below=150.0)  # fmt: skip
    template = for_site(season.site, START, 24)
    day = asked(strategy, genes, 0, template, weather[:24], season.recipe)[0]
    sun_up = np.array([one.sun_up for one in template.moments])
    warm = 20.0 + weather[:24, 3].mean() / 100.0
    np.testing.assert_allclose(day[:, 0], np.where(sun_up, warm, 17.0))
    hour = np.arange(24)
    np.testing.assert_array_equal(day[:, 2], (hour >= 2) & (hour < 14) & (weather[:24, 3] < 150.0))
    np.testing.assert_allclose(day[:, 1], np.where(sun_up | (day[:, 2] > 0), 800.0, 400.0))


def test_every_day_of_any_strategy_keeps_the_crops_limits(season: Season, weather: np.ndarray) -> None:
    strategy = Strategy(DAYS, 3)
    genes = np.random.default_rng(0).random((8, strategy.genes), dtype=np.float32)
    place, applied, memory, courses = Place.of(season.site), np.full((8, len(SETPOINTS)), np.nan), None, []
    for day in range(4):
        template = for_site(season.site, START + day * np.timedelta64(1, "D"), 24, radiation=weather[:24, 3])
        course = template.follow(asked(strategy, genes, day, template, weather[:24], season.recipe), applied, memory)
        applied, memory = course.setpoints[:, -1], course.memory
        courses.append(course.setpoints)
    sunlight = place.sunlight(1.0) * np.tile(weather[:24, 3], 4)
    seconds = float(START.astype(np.int64))
    for one in np.concatenate(courses, axis=1):
        assert violations(place, seconds, one[:, 0], one[:, 2], one[:, 1], sunlight) == []


def test_the_crop_keeps_its_books() -> None:
    """What it holds and has given grows by what it takes up less what it respires."""
    crop = like(tomato.mature_crop(PLANT, 1.0), 3)
    supply = np.full((3, 48), 1.2e-3) * np.array([[0.5], [1.0], [1.5]])
    after = live(PLANT, crop, supply, np.full((3, 48), 19.0), np.full((3, 48), 3.0))
    grown = after.net_growth - crop.net_growth
    np.testing.assert_allclose(tomato.stored_carbohydrate(after) - tomato.stored_carbohydrate(crop), grown, rtol=1e-9)
    assert (np.diff(grown) > 0).all()
    assert (after.buffer >= -1e-9).all()
    assert (fresh(PLANT, after) > fresh(PLANT, crop)).all()


def test_a_reference_crop_grows_as_the_simulator_says() -> None:
    """With neither an empty nor a full buffer, a mature crop's growth is the simulator's own."""
    crop = like(tomato.mature_crop(PLANT, 1.0, 3.0), 1)
    net = np.full((1, 24), 0.45e-3)
    air = np.full((1, 24), 19.0)
    for _ in range(6):
        before = crop.net_growth
        crop = tomato.deleaf(np, PLANT, live(PLANT, crop, supplied(PLANT, net, air), air, np.full((1, 24), 3.0)))
    assert float((crop.net_growth - before)[0]) == pytest.approx(24 * 0.45e-3, rel=0.25)


def test_a_crop_takes_up_what_as_many_leaves_took_up() -> None:
    """Of a simulator with a leaf area of 3.5 a crop of 3.5 has all, and a crop of 2 as much less as it shades less."""
    supply, air = np.full((1, 3), 1.2e-3), np.full((1, 3), 19.0)

    def taken_up(own: float) -> float:
        crop = like(tomato.mature_crop(PLANT, 1.0, own), 1)
        respired = tomato.rates(np, PLANT, crop, 19.0).respiration * 3 * 3600.0
        after = live(PLANT, crop, supply, air, np.full((1, 3), 3.5))
        return float((after.net_growth - crop.net_growth + respired)[0] / tomato.assimilation_share(np, crop)[0])

    assert taken_up(3.5) == pytest.approx(supply.sum(), rel=1e-9)
    shading = (1.0 - np.exp(-0.7 * 2.0)) / (1.0 - np.exp(-0.7 * 3.5))
    assert taken_up(2.0) == pytest.approx(shading * supply.sum(), rel=1e-9)


def test_growth_that_more_leaves_made_is_worth_less_to_a_crop(season: Season) -> None:
    strategy, crop = Strategy(DAYS, 1), tomato.mature_crop(PLANT, 1.0)
    grown = [
        float(run_season(one, strategy, genes_of(strategy), crop).crop.net_growth[0] - crop.net_growth)
        for one in (replace(season, simulator=ToySimulator(leaf_area=area)) for area in (3.0, 3.5))
    ]
    assert 0.93 * grown[0] < grown[1] < 0.99 * grown[0]


def test_only_fruit_that_was_ripe_is_paid(season: Season) -> None:
    strategy = Strategy(DAYS, 1)
    genes = np.concatenate([
        genes_of(strategy, day_temperature=18.0, night_temperature=16.0, warmer_by_sun=0.0),
        genes_of(strategy, day_temperature=22.0, night_temperature=19.0, warmer_by_sun=0.0),
    ])  # fmt: skip
    outcome = run_season(season, strategy, genes, tomato.mature_crop(PLANT, 1.0))
    assert outcome.harvest[1] > 1.1 * outcome.harvest[0], "warmth ripens"
    assert outcome.used["heat"][1] > outcome.used["heat"][0]
    dry = outcome.crop.harvested / PLANT.fruit_dry_matter
    np.testing.assert_allclose(outcome.harvest, dry)
    assert outcome.balance.income[0] == pytest.approx(float(outcome.harvest[0]) * 4.5, rel=0.25)


def test_marginal_values_tell_ripe_from_young(season: Season) -> None:
    """Eight days before the end old fruit is worth its price and young fruit nothing."""
    strategy = Strategy(DAYS, 1)
    genes = genes_of(strategy)[0]
    late = replace(season, days=8, weather=season.weather[:1], first_day=DAYS - 8)
    crop = tomato.mature_crop(PLANT, 1.0)
    values = marginal_values(late, strategy, genes, crop)
    price = 4.5 / PLANT.fruit_dry_matter
    assert values.fruit[-1] == pytest.approx(price, rel=0.3)
    assert abs(values.fruit[0]) < 0.03 * price
    assert (np.diff(values.fruit[:15]) > -1e-6).all()
    whole = marginal_values(season, strategy, genes, crop)
    assert whole.fruit[5] > 0.3 * price
    assert whole.leaf > values.leaf


def test_a_marginal_value_is_the_change_of_the_season_s_profit(season: Season) -> None:
    strategy, crop = Strategy(DAYS, 1), tomato.mature_crop(PLANT, 1.0)
    genes = genes_of(strategy)
    values = marginal_values(season, strategy, genes[0], crop)
    more = crop._replace(fruit=crop.fruit + 0.0005 * (np.arange(20) == 12))
    profit = [float(run_season(season, strategy, genes, one).balance.net_profit[0]) for one in (crop, more)]
    assert profit[1] - profit[0] == pytest.approx(0.0005 * values.fruit[12], rel=0.05)


def test_a_day_is_worth_what_it_does_to_the_crop(season: Season, weather: np.ndarray, recipe: np.ndarray) -> None:
    """A full buffer makes more growth worthless, which an average price cannot see."""
    strategy, crop = Strategy(DAYS, 1), tomato.mature_crop(PLANT, 1.0)
    values = marginal_values(season, strategy, genes_of(strategy)[0], crop)
    outcome = ToySimulator(members=(0.9, 1.1)).simulate({}, weather, np.stack([recipe, recipe]), START)
    time = START + np.arange(48) * np.timedelta64(3600, "s")

    def income(one: tomato.Crop, growth: float) -> np.ndarray:
        worth = CropWorth(season.site, PLANT, one, values)
        scaled = replace(outcome, net_growth=growth * outcome.net_growth)
        return Objective(season.site, time, worth=worth).value(scaled).balance.income

    hungry, full = crop._replace(buffer=0.002), crop._replace(buffer=0.0199)
    assert income(crop, 1.0).shape == (2, 2)
    gain = [float((income(one, 3.0) - income(one, 1.0)).mean()) for one in (hungry, full)]
    assert gain[0] > 0.0
    assert gain[1] < 0.95 * gain[0]


def test_a_season_without_weather_for_some_of_its_days_is_refused(season: Season) -> None:
    with pytest.raises(ValueError, match="4 typical days for 10 days each leave some of 41"):
        replace(season, days=41)
