"""Sources of decisions: their order, leases, plans that expire, the recipe."""

import datetime
from zoneinfo import ZoneInfo

import pytest

from igrow.core.yaml_schema import SchemaError, parse
from igrow.edge.hand_off import HandOff
from igrow.edge.image import Image, Quality, Value
from igrow.edge.ports import Plan
from igrow.edge.sources import (
    FreshPlan,
    GrowerOverride,
    HandsOff,
    LastValidPlan,
    Lease,
    PlanKeeper,
    Recipe,
    RecipeSource,
    WantedRecipe,
    decide,
    recipe_at,
    recipe_course,
)
from igrow.edge.sources.override import RECIPE as WISH
from igrow.edge.sources.override import read_leases, write_leases
from igrow.edge.state_file import StateFile, alone_in
from tests.control.control_fakes import image_of

T0 = 1_772_323_200.0
AMSTERDAM = ZoneInfo("Europe/Amsterdam")
SAFE = {"heating_setpoint": 18.0, "co2_setpoint": 400.0}


def override_in(path, boot=""):
    return GrowerOverride(StateFile(path, HandOff("state files")), boot)


def plan_of(start=T0, hours=24, valid=12):
    return Plan(
        created=start,
        start=start,
        step_seconds=3600.0,
        setpoints={"heating_setpoint": tuple(float(16 + hour % 10) for hour in range(hours))},
        valid_until=start + 3600.0 * valid,
        bundle="test",
    )


def sources(plan, tmp_path):
    keeper = PlanKeeper(lambda: plan)
    return [
        override_in(tmp_path / "override.json"),
        FreshPlan(keeper, fresh_for=6 * 3600.0),
        LastValidPlan(keeper),
        RecipeSource(Recipe(), AMSTERDAM),
        HandsOff(SAFE),
    ]


def heating(all_sources, monotonic, true_time):
    decision = decide(all_sources, Image(monotonic, true_time), ("heating_setpoint",))
    choice = decision.choices["heating_setpoint"]
    return choice.source, choice.value


def test_the_order_is_override_plan_last_plan_recipe_hands_off(tmp_path):
    plan = plan_of()
    every = sources(plan, tmp_path)
    assert heating(every, 0.0, T0) == ("plan", 16.0)
    assert heating(every, 3.5 * 3600, T0 + 3.5 * 3600) == ("plan", 19.0)
    assert heating(every, 7.0 * 3600, T0 + 7.0 * 3600) == ("last_plan", 23.0)
    assert heating(every, 12.0 * 3600, T0 + 12.0 * 3600)[0] == "recipe"
    write_leases(tmp_path / "override.json", {"heating_setpoint": Lease(21.0, 600.0)})
    assert heating(every, 12.0 * 3600, T0 + 12.0 * 3600) == ("override", 21.0)
    assert heating(every, 12.2 * 3600, T0 + 12.2 * 3600)[0] == "recipe"
    assert heating([HandsOff(SAFE)], 0.0, None) == ("hands_off", 18.0)


def test_each_setpoint_takes_its_own_first_source(tmp_path):
    write_leases(tmp_path / "override.json", {"co2_setpoint": Lease(500.0, 600.0)})
    decision = decide(sources(plan_of(), tmp_path), image_of(0.0, T0), tuple(SAFE))
    assert {name: choice.source for name, choice in decision.choices.items()} == {
        "heating_setpoint": "plan",
        "co2_setpoint": "override",
    }


def test_a_decision_says_why_not_the_sources_before_it(tmp_path):
    decision = decide(sources(None, tmp_path), image_of(0.0, T0), ("heating_setpoint",))
    assert decision.why == "the recipe (no plan has been made)"


def test_a_plan_is_followed_on_the_monotonic_clock_through_a_jump_of_the_date(tmp_path):
    every = sources(plan_of(), tmp_path)
    assert heating(every, 0.0, T0) == ("plan", 16.0)
    assert heating(every, 3600.0, T0 + 1e8) == ("plan", 17.0)
    assert heating(every, 7200.0, None) == ("plan", 18.0)


def test_a_plan_cannot_be_placed_while_the_clock_was_never_right(tmp_path):
    assert heating(sources(plan_of(), tmp_path), 0.0, None)[0] == "hands_off"


def test_a_plan_shorter_than_its_validity_ends_with_its_last_step(tmp_path):
    assert heating(sources(plan_of(hours=3), tmp_path), 3 * 3600.0, T0 + 3 * 3600.0)[0] == "recipe"


def test_a_lease_survives_a_restart_without_beginning_again(tmp_path):
    path = tmp_path / "override.json"
    write_leases(path, {"heating_setpoint": Lease(21.0, 7200.0)})
    first = override_in(path)
    assert first.offer(image_of(0.0, T0)).setpoints == {"heating_setpoint": 21.0}
    assert read_leases(path)["heating_setpoint"].until == T0 + 7200.0
    again = override_in(path)
    assert again.offer(image_of(50.0, T0 + 7100.0)).setpoints
    assert not again.offer(image_of(151.0, T0 + 7201.0)).setpoints


@pytest.mark.parametrize("jump", [1e9, -1e9, None])
def test_a_lease_survives_a_restart_with_its_remaining_time_whatever_the_date_does(tmp_path, jump):
    path = tmp_path / "override.json"
    write_leases(path, {"heating_setpoint": Lease(21.0, 7200.0)})
    assert override_in(path, "this boot").offer(image_of(1000.0, T0)).setpoints
    again = override_in(path, "this boot")
    date = None if jump is None else T0 + jump
    assert again.offer(image_of(8100.0, date)).setpoints == {"heating_setpoint": 21.0}
    assert not again.offer(image_of(8201.0, date)).setpoints


def test_a_lease_of_no_finite_length_is_none(tmp_path):
    path = tmp_path / "override.json"
    path.write_text(
        '{"heating_setpoint": {"value": 21, "seconds": NaN}, "co2_setpoint": {"value": 7, "seconds": 1e999}}'
    )
    assert not override_in(path).offer(image_of(0.0, T0)).setpoints


def test_a_lease_ends_on_time_although_the_date_jumps_back(tmp_path):
    path = tmp_path / "override.json"
    write_leases(path, {"heating_setpoint": Lease(21.0, 7200.0)})
    source = override_in(path)
    assert source.offer(image_of(0.0, T0)).setpoints
    assert not source.offer(image_of(7201.0, T0 - 1e6)).setpoints


def test_a_new_lease_replaces_the_old_one(tmp_path):
    path = tmp_path / "override.json"
    write_leases(path, {"heating_setpoint": Lease(21.0, 7200.0)})
    source = override_in(path)
    source.offer(image_of(0.0, T0))
    write_leases(path, {"heating_setpoint": Lease(17.0, 60.0)})
    assert source.offer(image_of(1.0, T0 + 1)).setpoints == {"heating_setpoint": 17.0}
    path.unlink()
    assert not source.offer(image_of(2.0, T0 + 2)).setpoints


@pytest.mark.parametrize("content", ["", "[1]", "{", '{"heating_setpoint": 5}', '{"heating_setpoint": {"value": "x"}}'])
def test_a_broken_override_file_overrides_nothing(tmp_path, content):
    path = tmp_path / "override.json"
    path.write_text(content)
    assert not override_in(path).offer(image_of(0.0, T0)).setpoints


RECIPE = """
heating_setpoint: [{at: 06:00, value: 20}, {at: 20:00, value: 17}]
co2_setpoint: []
lamp_on: [{at: 02:00, value: 1}, {at: 18:00, value: 0}]
lamps_off_above: 300
"""


@pytest.mark.parametrize(("hour", "value"), [(0, 17.0), (5, 17.0), (6, 20.0), (19, 20.0), (20, 17.0), (23, 17.0)])
def test_a_period_holds_until_the_next_one_also_over_midnight(hour, value):
    assert recipe_at(parse(RECIPE, Recipe), datetime.time(hour), None)["heating_setpoint"] == value


def test_an_empty_list_leaves_a_setpoint_to_the_next_source():
    assert "co2_setpoint" not in recipe_at(parse(RECIPE, Recipe), datetime.time(12), None)


def test_lamps_stay_off_in_strong_light():
    recipe = parse(RECIPE, Recipe)
    assert recipe_at(recipe, datetime.time(12), 299.0)["lamp_on"] == 1.0
    assert recipe_at(recipe, datetime.time(12), 301.0)["lamp_on"] == 0.0


def test_the_recipe_follows_local_time_through_the_change_of_clocks():
    recipe = parse(RECIPE, Recipe)
    source = RecipeSource(recipe, AMSTERDAM)
    night = datetime.datetime(2026, 3, 29, 0, 0, tzinfo=datetime.UTC).timestamp()
    hours = [source.offer(image_of(0.0, night + 3600 * hour)).setpoints["heating_setpoint"] for hour in range(8)]
    # At 01:00 UTC the clocks go from 02:00 to 03:00, so 06:00 is at 04:00 UTC.
    assert hours == [17.0] * 4 + [20.0] * 4


@pytest.mark.parametrize(("radiation", "value"), [(300.0, 20.0), (0.0, 17.0)])
def test_without_a_clock_light_tells_day_from_night_and_lamps_stay_with_the_safe_value(radiation, value):
    offer = RecipeSource(parse(RECIPE, Recipe), AMSTERDAM).offer(image_of(0.0, None, global_radiation=radiation))
    assert offer.setpoints["heating_setpoint"] == value
    assert "lamp_on" not in offer.setpoints


def test_without_clock_and_light_there_is_no_recipe():
    blind = Image(0.0, None, {"global_radiation": Value(300.0, Quality.FROZEN, 0.0)})
    assert not RecipeSource(parse(RECIPE, Recipe), AMSTERDAM).offer(blind).setpoints


def test_the_recipe_over_a_horizon_is_the_recipe_of_each_step():
    course = recipe_course(parse(RECIPE, Recipe), ZoneInfo("UTC"), T0, 3600.0, 24)
    assert course["heating_setpoint"][5:7] == (17.0, 20.0)
    assert len(course["lamp_on"]) == 24


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("heating_setpoint: [{at: 06:00, value: 99}]", "1:39: heating_setpoint is 99: 5 to 35 degC makes sense"),
        ("heating_setpoint: [{at: 06:00, value: 20}, {at: 05:00, value: 18}]", "must follow one another in the day"),
    ],
)
def test_a_recipe_that_makes_no_sense_is_refused_with_its_place(text, message):
    with pytest.raises(SchemaError) as error:
        parse(text, Recipe)
    assert message in str(error.value)


def wanting(path, plan, told=None):
    """The order of the daemon, with a journal that only listens."""
    said = [] if told is None else told
    override = GrowerOverride(
        StateFile(path, HandOff("state files")), tell=lambda kind, **detail: said.append((kind, detail))
    )
    keeper = PlanKeeper(lambda: plan)
    recipe, hands_off = RecipeSource(Recipe(irrigation_on=()), AMSTERDAM), HandsOff({**SAFE, "irrigation_on": 0.0})
    return [override, WantedRecipe(override, recipe, hands_off), FreshPlan(keeper, 6 * 3600.0), recipe, hands_off]


def test_the_recipe_goes_before_a_plan_while_the_grower_wants_it(tmp_path):
    path = tmp_path / "override.json"
    every = wanting(path, plan_of())
    assert heating(every, 0.0, T0) == ("plan", 16.0)
    write_leases(path, {WISH: Lease(1.0, 600.0)})
    decision = decide(every, Image(10.0, T0), ("heating_setpoint", "irrigation_on"))
    assert {choice.source for choice in decision.choices.values()} == {"recipe"}
    # What the recipe leaves open is not the plan's to fill.
    assert decision.choices["irrigation_on"].value == 0.0
    assert decision.why == "the recipe, wanted by the grower for 10 min more"
    assert heating(every, 611.0, T0 + 611.0) == ("plan", 16.0)


def test_a_setpoint_by_hand_goes_before_the_wanted_recipe(tmp_path):
    path = tmp_path / "override.json"
    every = wanting(path, plan_of())
    write_leases(path, {WISH: Lease(1.0, 600.0), "heating_setpoint": Lease(21.0, 600.0)})
    assert heating(every, 0.0, T0) == ("override", 21.0)


def test_the_wanted_recipe_is_safe_where_nobody_knows_the_time_of_day(tmp_path):
    path = tmp_path / "override.json"
    write_leases(path, {WISH: Lease(1.0, 600.0)})
    assert heating(wanting(path, plan_of()), 0.0, None) == ("recipe", 18.0)


def test_who_takes_and_gives_back_is_told_once(tmp_path):
    path = tmp_path / "override.json"
    told: list[tuple[str, dict[str, object]]] = []
    every = wanting(path, None, told)
    write_leases(path, {"heating_setpoint": Lease(21.0, 600.0, by="Anna"), WISH: Lease(1.0, 600.0, by="Anna")})
    for second in range(3):
        heating(every, float(second), T0 + second)
    assert told == [
        ("overridden", {"setpoint": "heating_setpoint", "value": 21.0, "seconds": 600.0, "by": "Anna"}),
        ("recipe_wanted", {"seconds": 600.0, "by": "Anna"}),
    ]
    again: list = []
    heating(wanting(path, None, again), 5.0, T0 + 5.0)
    assert again == []  # a restart finds what it has told before
    write_leases(path, {}, "Bert")
    heating(every, 6.0, T0 + 6.0)
    assert sorted(told[2:]) == [
        ("given_back", {"setpoint": "heating_setpoint", "by": "Bert"}),
        ("plans_wanted", {"by": "Bert"}),
    ]


def test_what_ends_by_itself_was_given_back_by_nobody(tmp_path):
    path = tmp_path / "override.json"
    told: list[tuple[str, dict[str, object]]] = []
    every = wanting(path, None, told)
    write_leases(path, {"heating_setpoint": Lease(21.0, 60.0, by="Anna")})
    heating(every, 0.0, T0)
    heating(every, 61.0, T0 + 61.0)
    write_leases(path, {}, "Bert")
    heating(every, 62.0, T0 + 62.0)
    assert [kind for kind, _ in told] == ["overridden"]


def test_a_lease_that_another_change_leaves_undated_does_not_begin_anew(tmp_path):
    path = tmp_path / "override.json"
    told: list[tuple[str, dict[str, object]]] = []
    every = wanting(path, None, told)
    mine = {"heating_setpoint": Lease(21.0, 600.0, by="Anna", asked=1)}
    write_leases(path, mine)
    heating(every, 0.0, T0)
    # Somebody has read the file before the daemon dated it, and writes it with a wish of his own.
    write_leases(path, mine | {"co2_setpoint": Lease(500.0, 600.0, by="Bert", asked=2)})
    heating(every, 300.0, T0 + 300.0)
    assert [(detail["setpoint"], detail["by"]) for _, detail in told] == [
        ("heating_setpoint", "Anna"), ("co2_setpoint", "Bert"),
    ]  # fmt: skip
    assert heating(every, 601.0, T0 + 601.0)[0] == "recipe"
    # The same wish once more is a new one.
    write_leases(path, {"heating_setpoint": Lease(21.0, 600.0, by="Anna", asked=3)})
    assert heating(every, 602.0, T0 + 602.0)[0] == "override"


def test_the_daemon_dates_no_lease_while_somebody_else_changes_the_file(tmp_path):
    path = tmp_path / "override.json"
    source = override_in(path)
    write_leases(path, {"heating_setpoint": Lease(21.0, 600.0, asked=1)})
    with alone_in(tmp_path):
        assert source.offer(image_of(0.0, T0)).setpoints == {"heating_setpoint": 21.0}
        assert read_leases(path)["heating_setpoint"].seen is None
