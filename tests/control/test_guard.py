"""The guard's decisions, one rule at a time."""

import math
from dataclasses import replace

import pytest

from igrow.core.site.control import Limits
from igrow.edge.guard import Bound, GuardRules, GuardState, Interlock, PointRule, PointState, Request, guard
from igrow.edge.guard.core import with_earlier_writes
from igrow.edge.guard.interlocks import DEFAULT_INTERLOCKS, SAFE, InterlockError
from igrow.edge.guard.rules import GuardRuleError
from igrow.edge.image import Image, Quality, Value
from tests.control.control_fakes import image_of

POINT = PointRule(low=10.0, high=30.0, safe=18.0)


def ask(
    value, rule=POINT, *, shown=18.0, state=None, image=None, interlocks=(), held=None, name="heating_setpoint", **more
):
    rules = GuardRules({name: rule}, interlocks)
    requests = {} if value is None else {name: Request(value, "plan")}
    return guard(requests, {name: shown}, held or {}, image or image_of(1000.0), state or GuardState(), rules, **more)


def values(verdict):
    return [write.value for write in verdict.writes]


def kinds(verdict):
    return [clamp.kind for clamp in verdict.clamps]


def test_a_request_within_all_limits_is_written_as_it_is():
    verdict = ask(21.5)
    assert values(verdict) == [21.5]
    assert not verdict.clamps


@pytest.mark.parametrize(("asked", "written"), [(99.0, 30.0), (-99.0, 10.0)])
def test_a_request_outside_the_limits_is_cut_and_leaves_a_row(asked, written):
    verdict = ask(asked)
    assert values(verdict) == [written]
    assert verdict.clamps[0].requested == asked
    assert verdict.clamps[0].applied == written
    assert verdict.clamps[0].kind == "limit"


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -math.inf])
def test_a_request_that_is_no_number_is_refused(nonsense):
    verdict = ask(nonsense)
    assert values(verdict) == []
    assert kinds(verdict) == ["refused"]


def test_slew_lets_a_ramp_run_from_what_stands_in_the_plc():
    rule = replace(POINT, slew=0.01)
    state = ask(25.0, rule, image=image_of(0.0)).state
    verdict = ask(25.0, rule, state=state, image=image_of(100.0))
    assert values(verdict) == pytest.approx([19.0])
    assert kinds(verdict) == ["slew"]


def test_a_ramp_under_the_dead_band_adds_up_until_it_is_worth_a_write():
    rule = replace(POINT, slew=0.001, dead_band=0.485)
    state, shown, written = GuardState(), 18.0, []
    for second in range(0, 2000, 10):
        verdict = ask(20.0, rule, state=state, shown=shown, image=image_of(float(second)))
        state = verdict.state
        if verdict.writes:
            shown = verdict.writes[0].value
            written.append(shown)
    assert written == pytest.approx([18.49, 18.98, 19.47, 19.96])


def test_a_ramp_never_makes_up_for_a_long_absence_at_once():
    rule = replace(POINT, slew=0.01)
    state = ask(30.0, rule, image=image_of(0.0)).state
    verdict = ask(30.0, rule, state=state, image=image_of(1e6))
    assert values(verdict) == pytest.approx([27.0])


def test_nothing_is_written_within_the_dead_band():
    assert values(ask(18.3, replace(POINT, dead_band=0.5))) == []


def test_a_value_outside_the_limits_is_brought_back_whatever_the_dead_band():
    assert values(ask(30.0, replace(POINT, dead_band=0.5), shown=30.3)) == [30.0]


def test_writes_keep_the_minimum_interval_and_say_so():
    rule = replace(POINT, minimum_interval=300.0)
    first = ask(20.0, rule, image=image_of(1000.0))
    early = ask(22.0, rule, shown=20.0, state=first.state, image=image_of(1299.0))
    late = ask(22.0, rule, shown=20.0, state=early.state, image=image_of(1300.0))
    assert values(first) == [20.0]
    assert values(early) == []
    assert kinds(early) == ["minimum_interval"]
    assert values(late) == [22.0]


def test_a_value_that_stands_is_not_written_again():
    first = ask(20.0)
    assert values(ask(20.0, shown=20.0, state=first.state, image=image_of(9000.0))) == []


def test_a_register_that_expires_is_refreshed():
    rule = replace(POINT, refresh=600.0)
    first = ask(20.0, rule, image=image_of(0.0))
    assert values(ask(20.0, rule, shown=20.0, state=first.state, image=image_of(599.0))) == []
    assert values(ask(20.0, rule, shown=20.0, state=first.state, image=image_of(600.0))) == [20.0]


def test_the_daily_budget_holds_and_keeps_a_reserve_for_interlocks():
    rule = replace(POINT, daily_budget=10)
    state, shown, written = GuardState(), 18.0, 0
    for number in range(40):
        verdict = ask(20.0 + number % 2, rule, state=state, shown=shown, image=image_of(60.0 * number))
        state, written = verdict.state, written + len(verdict.writes)
        shown = verdict.writes[0].value if verdict.writes else shown
    assert written == 9
    assert kinds(verdict) == ["budget"]
    frost = Interlock("frost", "air_temperature", {"heating_setpoint": Bound(low=25.0)}, below=8.0, release=10.0)
    urgent = ask(20.0, rule, state=state, shown=shown, image=image_of(4000.0, air_temperature=2.0), interlocks=(frost,))
    assert values(urgent) == [25.0]


def test_the_budget_is_given_back_after_a_day():
    rule = replace(POINT, daily_budget=2)
    state = with_earlier_writes(GuardState(), {"heating_setpoint": [0.0, 10.0]})
    assert values(ask(20.0, rule, state=state, image=image_of(86_399.0))) == []
    assert values(ask(20.0, rule, state=state, image=image_of(86_410.0))) == [20.0]


def test_an_unknown_beginning_begins_at_the_safe_value():
    assert values(ask(25.0, replace(POINT, slew=0.01), shown=None)) == [18.0]


def test_a_change_by_hand_is_left_alone_while_it_is_respected():
    verdict = ask(25.0, held={"heating_setpoint": 600.0})
    assert values(verdict) == []
    assert kinds(verdict) == ["hand"]


WIND = Interlock(
    "wind",
    "wind_speed",
    {"vent_lee": Bound(high=0.0)},
    above=15.0,
    release=12.0,
    when_unknown={"vent_lee": Bound(high=20.0)},
)
VENT = PointRule(low=0.0, high=100.0, safe=0.0, slew=0.01, dead_band=5.0, minimum_interval=300.0)


def ask_vent(value, wind, *, quality=Quality.GOOD, state=None, shown=80.0, **more):
    image = Image(1000.0, None, {"wind_speed": Value(wind, quality, 0.0)})
    return ask(value, VENT, image=image, interlocks=(WIND,), name="vent_lee", shown=shown, state=state, **more)


def test_wind_closes_vents_without_waiting_for_slew_or_interval():
    state = GuardState({"vent_lee": PointState(80.0, 80.0, 990.0)}, at=990.0)
    verdict = ask_vent(80.0, 20.0, state=state)
    assert values(verdict) == [0.0]
    assert kinds(verdict) == ["interlock"]
    assert verdict.writes[0].urgent


def test_wind_closes_vents_that_nobody_asks_about():
    assert values(ask_vent(None, 20.0)) == [0.0]


def test_wind_closes_vents_that_a_hand_has_opened():
    assert values(ask_vent(80.0, 20.0, held={"vent_lee": 3000.0})) == [0.0]


def test_wind_closes_vents_that_are_only_on_their_slow_way_down():
    state = GuardState({"vent_lee": PointState(80.0, 80.0, 990.0)}, at=990.0)
    assert values(ask_vent(0.0, 20.0, state=state)) == [0.0]


def test_an_interlock_lets_go_only_beyond_its_release():
    engaged = ask_vent(80.0, 16.0).state
    assert ask_vent(80.0, 13.0, state=engaged).engaged
    assert not ask_vent(80.0, 11.9, state=engaged).engaged


@pytest.mark.parametrize("quality", [q for q in Quality if q not in (Quality.GOOD, Quality.STALE)])
def test_a_wind_sensor_that_cannot_be_believed_takes_the_safe_side(quality):
    assert values(ask_vent(80.0, 3.0, quality=quality)) == [20.0]


def test_a_stale_wind_sensor_still_guards():
    assert values(ask_vent(80.0, 20.0, quality=Quality.STALE)) == [0.0]


def test_a_sensor_that_fails_in_a_storm_keeps_the_vents_shut():
    engaged = ask_vent(80.0, 20.0).state
    verdict = ask_vent(80.0, 3.0, quality=Quality.FROZEN, state=engaged)
    assert values(verdict) == [0.0]


def test_the_earlier_interlock_wins_where_two_pull_apart():
    humidity = Interlock("humidity", "air_humidity", {"vent_lee": Bound(low=30.0)}, above=95.0, release=90.0)
    image = image_of(0.0, wind_speed=20.0, air_humidity=99.0)
    verdict = ask(50.0, VENT, image=image, interlocks=(WIND, humidity), name="vent_lee", shown=50.0)
    assert values(verdict) == [0.0]


def test_interlocks_leave_first():
    rules = GuardRules({"heating_setpoint": POINT, "vent_lee": VENT}, (WIND,))
    requests = {"heating_setpoint": Request(20.0, "plan"), "vent_lee": Request(80.0, "plan")}
    verdict = guard(
        requests, {"heating_setpoint": 18.0, "vent_lee": 80.0}, {}, image_of(0.0, wind_speed=20.0), GuardState(), rules
    )
    assert [write.point for write in verdict.writes] == ["vent_lee", "heating_setpoint"]


def test_stopping_writes_the_safe_value_at_once():
    rule = replace(POINT, slew=0.001, minimum_interval=3600.0)
    state = GuardState({"heating_setpoint": PointState(25.0, 25.0, 990.0)}, at=990.0)
    assert values(ask(None, rule, shown=25.0, state=state, stopping=True)) == [18.0]


@pytest.mark.parametrize(
    ("readings", "point", "asked", "written"),
    [
        ({"wind_speed": 20.0}, "vent_wind", 50.0, 0.0),
        ({"wind_alarm": 1.0}, "vent_lee", 50.0, 10.0),
        ({"rain": 1.0}, "vent_wind", 50.0, 10.0),
        ({"air_temperature": 3.0}, "heating_setpoint", 12.0, 18.0),
        ({"air_temperature": 40.0}, "lamp_on", 1.0, 0.0),
        ({"air_humidity": 98.5}, "irrigation_on", 0.8, 0.0),
        ({"air_co2": 2500.0}, "co2_setpoint", 900.0, 400.0),
    ],
)
def test_the_built_in_interlocks_do_what_they_are_for(readings, point, asked, written):
    low, high, safe = {
        "heating_setpoint": (5.0, 30.0, 18.0),
        "co2_setpoint": (400.0, 1000.0, 400.0),
    }.get(point, (0.0, 100.0, 0.0))
    rule = PointRule(low=low, high=high, safe=safe)
    verdict = ask(asked, rule, shown=asked, name=point, image=image_of(0.0, **readings), interlocks=DEFAULT_INTERLOCKS)
    assert values(verdict) == [written]


def test_rules_that_no_value_can_satisfy_are_refused():
    with pytest.raises(GuardRuleError, match="safe value"):
        PointRule(low=10.0, high=30.0, safe=40.0)
    with pytest.raises(GuardRuleError, match="refreshing"):
        PointRule(low=10.0, high=30.0, safe=20.0, refresh=600.0, daily_budget=48)
    with pytest.raises(InterlockError, match="release"):
        Interlock("x", "wind_speed", {"vent_lee": Bound(high=SAFE)}, above=10.0, release=12.0)


@pytest.mark.parametrize(
    ("asked", "humidity", "written"),
    [(88.0, 80.0, 88.0), (99.0, 80.0, 90.0), (40.0, 80.0, 70.0), (88.0, 98.0, 85.0), (78.0, 98.0, 78.0)],
)
def test_a_humidity_setpoint_keeps_its_limits_and_is_no_damper_than_safe_over_a_wet_crop(asked, humidity, written):
    limits = Limits().humidity_setpoint
    rule = PointRule(low=limits.low, high=limits.high, safe=limits.safe)
    image = image_of(0.0, air_humidity=humidity)
    verdict = ask(asked, rule, shown=86.0, name="humidity_setpoint", image=image, interlocks=DEFAULT_INTERLOCKS)
    assert values(verdict) == [written]
