"""What the page says: names, numbers, local times, who decides, what is as wanted, why the plan is so, and euros."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from igrow.core.co2_count import CO2Count
from igrow.core.language import ENGLISH
from igrow.core.site import load_site
from igrow.edge.configuration import load_configuration
from igrow.edge.notifications.acknowledged import Acknowledgement
from igrow.edge.page import money, now, setpoints
from igrow.edge.page.history import Course
from igrow.edge.page.pages import render
from igrow.edge.page.plan import Block, blocks, limit_words, next_change
from igrow.edge.page.state import Heard
from igrow.edge.page.view import Known, as_log, compose
from igrow.edge.page.words import Words
from igrow.edge.sources.override import Lease
from igrow.edge.sources.recipe import Recipe, recipe_course
from tests.page.page_bench import NOW, alarm, amount, change, clamp, plan, state, write_greenhouse

ZONE = ZoneInfo("Europe/Amsterdam")
SAY = Words(ENGLISH, ZONE)


@pytest.fixture
def site(tmp_path):
    write_greenhouse(tmp_path)
    return load_site(tmp_path / "site.yaml")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("air_temperature", 19.44, "19.4 °C"), ("air_temperature", -0.04, "0.0 °C"), ("lamp_on", 0.5, "50 %"),
        ("air_co2", 741.6, "742 ppm"), ("air_humidity", None, "–"), ("air_humidity", float("nan"), "–"),
    ],
)  # fmt: skip
def test_values_are_said_in_the_growers_units(name, value, said):
    assert SAY.shown(name, value) == said


@pytest.mark.parametrize(
    ("amount", "said"),
    [(1.234, "+1.23 €"), (-1.239, "−1.24 €"), (0.001, "0.00 €"), (12345.6, "+12,346 €"), (float("nan"), "–")],
)
def test_money_is_said_for_the_whole_greenhouse(amount, said):
    assert SAY.euro(amount, sign=True) == said


@pytest.mark.parametrize(
    ("away", "said"),
    [(3600.0, "17:00"), (-3600.0, "15:00"), (9 * 3600.0, "tomorrow 01:00"), (-86_400.0, "yesterday 16:00"),
     (5 * 86_400.0, "Thu 19 Mar 16:00")],
)  # fmt: skip
def test_times_are_said_as_people_do(away, said):
    assert SAY.when(NOW + away, NOW) == said


def test_the_daemons_times_become_those_of_the_site():
    assert SAY.told("the plan of 14 Mar 15:00 UTC", NOW) == "the plan of 16:00"
    assert SAY.told("until 31 Dec 23:30 UTC", 1_767_225_000.0) == "until 00:30"
    assert SAY.told("99 Foo 25:00 UTC", NOW) == "99 Foo 25:00 UTC"


def test_names_of_points_are_said_as_words():
    assert SAY.sentence("air_co2 is frozen", NOW) == "CO₂ is frozen."
    assert SAY.title("co2_setpoint") == "CO₂ setpoint"


@pytest.mark.parametrize(
    ("heard", "tone", "said"),
    [
        (Heard(None, "no daemon answers", 30.0), "bad", "The controller is not heard"),
        (Heard(state(), "no daemon answers", 600.0), "bad", "The controller is not heard"),
        (Heard(None), "bad", "The controller is not heard"),
        (Heard(state(link_ok=False)), "bad", "The plant is not heard"),
        (Heard(state(alarms=[alarm("link", "x", "critical")])), "bad", "Go and look now"),
        (Heard(state()), "warn", "Running, with something to look at"),
        (Heard(state(alarms=[], problems=["disk"])), "warn", "Running, with something to look at"),
        (Heard(state(alarms=[], clock_ok=False)), "warn", "Running, with something to look at"),
        (Heard(state(alarms=[alarm("interlock rain", "x", "notice")])), "good", "All is well"),
        (Heard(state(alarms=[])), "good", "All is well"),
        (Heard(state(alarms=[], problems=["the first plan needs a day of log: 4 h more"])), "good", "All is well"),
    ],
)
def test_the_headline_is_the_worst_that_is(heard, tone, said):
    headline = now.headline(heard, SAY, NOW)
    assert (headline.tone, headline.text) == (tone, said)


def test_old_values_are_not_called_well(site):
    assert {card.tone for card in now.cards(state(), site, SAY, NOW, old=True)} == {"warn"}


@pytest.mark.parametrize(
    ("name", "value", "tone", "mark"),
    [
        ("air_temperature", 20.4, "good", "✓"), ("air_temperature", 18.0, "warn", "▼"),
        ("air_temperature", 12.0, "bad", "▼"), ("air_temperature", 33.0, "bad", "▲"),
        ("air_temperature", 25.0, "good", "✓"), ("air_humidity", 95.0, "warn", "▲"),
        ("air_humidity", 80.0, "good", "✓"),
        ("air_co2", 500.0, "plain", "▼"), ("air_co2", 830.0, "good", "✓"), ("par", 100.0, "plain", ""),
    ],
)  # fmt: skip
def test_what_is_measured_is_judged_in_words_and_marks(site, name, value, tone, mark):
    measured = {"value": value, "quality": "good", "age": 1.0, "why": ""}
    found, said = now.judge(name, measured, state(), site, SAY, NOW)
    assert (found, said[:1]) == (tone, mark)


def test_a_value_that_is_not_good_says_why(site):
    value = {"value": 4.1, "quality": "out_of_range", "age": 1.0, "why": "above 60"}
    assert now.judge("air_temperature", value, state(), site, SAY, NOW) == ("warn", "! out of range: above 60")


def test_alarms_stand_in_the_order_of_what_they_ask_and_say_who_knows():
    said = state(alarms=[alarm("a", "x", "notice"), alarm("b", "y", "critical"), alarm("c", "z", "warning")])
    found = now.alarms(said, {"b": Acknowledgement("Anna", NOW - 60.0)}, NOW, SAY)
    assert [one.level for one in found] == ["critical", "warning", "notice"]
    assert found[0].known == "known to Anna since 15:59"


def test_routine_ramps_are_apart_from_what_matters():
    clamps = [
        clamp("co2_setpoint", 900.0, 850.0, "slew of 600 ppm per hour on the way to 900 ppm"),
        clamp("co2_setpoint", 900.0, 850.0, "written 20 s ago, at least 300 s apart"),
        clamp("heating_setpoint", 20.0, 19.0, "the crop's temperature_drift"),
        clamp("heating_setpoint", 31.0, 28.0, "above the limit of 28 degC"),
        clamp("heating_setpoint", 31.0, 27.0, "above the limit of 28 degC; slew of 4 K per hour on the way to 28 degC"),
        clamp("co2_setpoint", 900.0, 400.0, "interlock wind: too much"),
    ]
    matters, routine = now.held_back(clamps, NOW, SAY)
    assert (len(matters), len(routine)) == (3, 3)


def test_a_setpoint_says_who_has_taken_it_and_until_when(site):
    leases = {"heating_setpoint": Lease(18.0, 7200.0, NOW + 3600.0, by="Anna (page)")}
    found = {one.name: one for one in setpoints.setpoints(state(), leases, site, NOW, SAY)}
    assert found["heating_setpoint"].lease == "until 17:00, by Anna (page)"
    assert found["co2_setpoint"].wanted == "on its way to 900 ppm"
    assert found["lamp_on"].next == "0 % from 17:00"
    over = {"heating_setpoint": Lease(18.0, 7200.0, NOW - 1.0)}
    assert setpoints.setpoints(state(), over, site, NOW, SAY)[0].lease == ""


def test_a_plan_that_waits_for_its_log_is_no_problem_and_is_told():
    said = state(problems=["the first plan needs a day of log: 4 h more", "the disk is full"])
    assert now.problems(said, SAY, NOW) == ["The disk is full."]
    assert now.waiting(said, SAY, NOW) == "The first plan needs a day of log: 4 h more."
    assert now.waiting(state(), SAY, NOW) == ""


def test_a_setpoint_that_a_hand_at_the_plc_has_set_says_so(site):
    said = state()
    said["setpoints"]["lamp_on"]["held_until"] = said["monotonic"] + 5400.0
    found = {one.name: one for one in setpoints.setpoints(said, {}, site, NOW, SAY)}
    assert (found["lamp_on"].decider, found["lamp_on"].why) == ("A hand at the PLC", "respected for 2 h more")


def test_what_the_plan_asks_for_next():
    assert next_change(plan(), "heating_setpoint", NOW, SAY) == "19.0 °C from 17:00"
    assert next_change(None, "heating_setpoint", NOW, SAY) == ""
    assert next_change(plan(), "heating_setpoint", NOW + 1e6, SAY) == ""


def explained(site, made=None) -> list[Block]:
    made = made or plan()
    recipe = recipe_course(Recipe(), ZONE, made["start"], made["step_seconds"], 24)
    return blocks(made, recipe, site.greenhouse.floor_area, site.crop.agronomy, SAY)


def test_each_hour_of_each_setpoint_is_in_one_block_with_a_sentence(site):
    found = explained(site)
    for name in plan()["setpoints"]:
        own = [block for block in found if block.setpoint == name]
        assert own[0].start == NOW
        assert own[-1].end == NOW + 86_400.0
        assert all(one.end == other.start for one, other in pairwise(own))
    assert all(block.why.endswith(".") for block in found)


def test_a_block_says_what_it_is_for_in_euros_of_this_greenhouse(site):
    (lamps,) = [block for block in explained(site) if block.setpoint == "lamp_on" and not block.same]
    assert lamps.why == (
        "More lamp light than your recipe (0 %): growth worth 46.00 € more; 4.00 € less for heat; "
        "26.00 € more for electricity; together +24.00 €, between +19.30 € and +28.70 €."
    )


def test_a_block_names_the_limit_that_holds_it(site):
    (held,) = [block for block in explained(site) if block.limits]
    assert held.setpoint == "heating_setpoint"
    assert held.limits == ("temperature at night, 15 to 20 °C",)


def test_a_plan_without_an_explanation_is_told_all_the_same(site):
    found = explained(site, plan(explanation=None, binding={}))
    assert "Cooler than your recipe (17.0 °C)." in [block.why for block in found]


@pytest.mark.parametrize(
    "limit",
    ["day_temperature", "night_temperature", "mean_temperature", "temperature_difference", "temperature_drift",
     "dark_hours", "light_sum_high", "co2_with_people", "rest"],
)  # fmt: skip
def test_every_limit_of_the_crop_has_its_words(site, limit):
    assert limit_words(limit, site.crop.agronomy, SAY) != limit.replace("_", " ") or limit == "rest"


def test_the_gain_is_said_with_its_doubt_and_the_rows_add_up(site):
    found = money.expected(plan(), 1000.0, SAY)
    assert found is not None
    assert found.gain == "The plan is expected to bring 38.00 € more than your recipe, between +30.16 € and +45.84 €."
    rows = {title: ours for title, ours, *_ in found.rows}
    assert rows == {
        "Growth, when it is sold": "392.00 €", "Heat": "41.00 €", "Electricity": "93.00 €", "CO₂": "18.00 €",
        "Upkeep of the crop": "26.00 €", "What is left": "214.00 €",
    }  # fmt: skip


def gain_of(plan: dict) -> str:
    found = money.expected(plan, 100.0, SAY)
    assert found is not None
    return found.gain


def test_a_plan_that_loses_or_changes_nothing_is_not_called_a_gain():
    worse = plan()
    worse["explanation"] = worse["explanation"] | {"gain": amount(-0.01)}
    assert gain_of(worse) == "The plan is expected to bring 1.00 € less than your recipe."
    worse["explanation"] = worse["explanation"] | {"gain": amount(0.0)}
    assert gain_of(worse) == "The plan and your recipe are expected to bring the same."
    assert money.expected(plan(explanation=None), 100.0, SAY) is None


def test_what_today_has_cost_is_told_from_the_actuators(site):
    time = np.arange(NOW - 86_400.0, NOW, 300.0) + 150.0
    steady = {"air_temperature": 20.0, "rail_pipe_temperature": 40.0, "lamp_power": 100.0, "co2_dosing": 0.01}
    log = as_log({name: Course(time, *[np.full(len(time), value)] * 3) for name, value in steady.items()})
    found = money.spent(site, log, NOW, ZONE)
    assert found.hours == 16
    # 2.1 W m-2 K-1 x 20 K for 16 h on 1000 m2 at 0.0083 EUR MJ-1
    assert found.costs["heat"] == pytest.approx(2.1 * 20 * 16 * 3600 * 1e-6 * 1000 * 0.0083, rel=0.01)
    # 0.1 kWh m-2 an hour: seven hours off peak, nine at the peak's price
    assert found.costs["electricity"] == pytest.approx(0.1 * 1000 * (7 * 0.04 + 9 * 0.08), rel=0.01)
    # The crop had 0.24 kg m-2 a day for 88 days, so that the dearer tier is reached.
    assert found.costs["co2"] == pytest.approx(0.01 * 16 * 1000 * 0.20, rel=0.01)
    # Yet a count from plan to plan says that it dosed less before.
    cheap = money.spent(site, log, NOW, ZONE, CO2Count(NOW - 86_400.0, 5.0))
    assert cheap.costs["co2"] == pytest.approx(0.01 * 16 * 1000 * 0.08, rel=0.01)
    assert money.spent(site, as_log({}), NOW, ZONE).total != found.total


def test_a_change_that_is_not_among_the_told_ones_says_so(site):
    made = plan()
    made["explanation"] = made["explanation"] | {"changes": [change("co2_setpoint", 9, 24, 900.0, 800.0, income=0.01)]}
    assert any("a small change, not among those that matter most" in block.why for block in explained(site, made))


def test_a_page_is_composed_of_any_state(tmp_path):
    configuration = load_configuration(write_greenhouse(tmp_path))
    bare = state(plan=None, values={}, setpoints={}, clamps=[], bundle={}, time=None, clock_ok=False)
    for heard in (Heard(None, "silent"), Heard(bare), Heard(state()), Heard(state(), "silent", 90.0)):
        assert compose(Known(configuration, heard, NOW))["headline"].text


def leaves(plain: object, path: tuple = ()) -> Iterator[tuple]:
    """Where the numbers of a plain structure stand."""
    if isinstance(plain, dict | list):
        for key, one in plain.items() if isinstance(plain, dict) else enumerate(plain):
            yield from leaves(one, (*path, key))
    elif isinstance(plain, float):
        yield path


def rendered(configuration, said) -> str:
    shown = compose(Known(configuration, Heard(said), NOW))
    return render("page.html", {**shown, "session": None, "said": "", "said_well": True}).body.decode()


def test_a_number_that_is_none_anywhere_in_the_state_keeps_no_page_from_being_made(tmp_path, caplog):
    configuration = load_configuration(write_greenhouse(tmp_path))
    certain = {("plan", "start"), ("plan", "step_seconds"), ("plan", "valid_until"), ("monotonic",)}
    places = [path for path in leaves(state()) if path not in certain]
    assert len(places) > 150
    for path in places[:: max(1, len(places) // 60)]:
        said = state()
        there: Any = said
        for key in path[:-1]:
            there = there[key]
        there[path[-1]] = None
        page = rendered(configuration, said)
        assert "The plan decides" in page, path
        assert "nan" not in re.sub(r"<[^>]*>", "", page), path
    assert "cannot be shown" not in caplog.text


def test_a_fault_in_telling_the_plan_leaves_alarms_and_measurements_to_be_seen(tmp_path, monkeypatch):
    configuration = load_configuration(write_greenhouse(tmp_path))
    monkeypatch.setattr("igrow.edge.page.plan.blocks", lambda *_: 1 / 0)
    page = rendered(configuration, state())
    assert "cannot be shown" in page
    assert "Wind speed is frozen" in page
    assert "21.3" in page
