"""What holds for the guard whatever it is asked, by hypothesis."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from igrow.edge.guard import Bound, GuardRules, GuardState, Interlock, PointRule, Request, guard
from igrow.edge.guard.answers import rounds
from igrow.edge.guard.core import DAY
from igrow.edge.image import Image, Quality, Value
from tests.control.control_fakes import image_of

ANY_FLOAT = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-100.0, 200.0),
    st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, 0.0, 5e-324]),
)


@st.composite
def point_rules(draw):
    low = draw(st.floats(-50.0, 50.0))
    high = low + draw(st.floats(0.0, 100.0))
    return PointRule(
        low=low,
        high=high,
        safe=draw(st.floats(low, high)),
        slew=draw(st.one_of(st.none(), st.floats(0.0, 0.1))),
        dead_band=draw(st.floats(0.0, 5.0)),
        minimum_interval=draw(st.floats(0.0, 600.0)),
        refresh=None,
        daily_budget=draw(st.one_of(st.none(), st.integers(2, 20))),
    )


QUALITIES = st.sampled_from(list(Quality))
STEP = st.tuples(
    st.floats(0.0, 20_000.0),
    st.one_of(st.none(), ANY_FLOAT),
    st.one_of(st.none(), ANY_FLOAT),
    ANY_FLOAT,
    QUALITIES,
    st.booleans(),
    st.booleans(),
)
FORCE = Interlock(
    "force",
    "wind_speed",
    {"point": Bound(low=3.0, high=7.0)},
    above=15.0,
    release=10.0,
    when_unknown={"point": Bound(high=5.0)},
)


@given(rule=point_rules(), steps=st.lists(STEP, max_size=12))
@settings(max_examples=300, deadline=None)
def test_no_write_ever_leaves_the_limits_or_the_budget(rule, steps):
    """Arbitrary requests, read-backs, sensors, holds and stops; the PLC may show nonsense."""
    rules, state, now = GuardRules({"point": rule}, (FORCE,)), GuardState(), 0.0
    written: list[float] = []
    for passed, asked, shown, wind, quality, held, stopping in steps:
        now += passed
        image = Image(now, None, {"wind_speed": Value(wind, quality, 0.0)})
        requests = {} if asked is None else {"point": Request(asked, "plan")}
        verdict = guard(
            requests, {"point": shown}, {"point": 60.0} if held else {}, image, state, rules, stopping=stopping
        )
        state = verdict.state
        for write in verdict.writes:
            assert rule.low <= write.value <= rule.high
            written.append(now)
    if rule.daily_budget is not None:
        for at in written:
            assert sum(at <= other < at + DAY for other in written) <= rule.daily_budget


@given(
    rule=point_rules(),
    first=ANY_FLOAT,
    steps=st.lists(st.tuples(st.floats(0.0, 5_000.0), ANY_FLOAT, st.booleans()), max_size=15),
)
@settings(max_examples=300, deadline=None)
def test_the_plc_never_sees_a_step_that_the_slew_does_not_allow(rule, first, steps):
    """A PLC that takes or loses each write; nobody else touches it."""
    rules, state, now = GuardRules({"point": rule}), GuardState(), 0.0
    stands = min(max(first, rule.low), rule.high) if math.isfinite(first) else rule.safe
    changed_at = 0.0
    for passed, asked, taken in steps:
        now += passed
        requests = {"point": Request(asked, "plan")}
        verdict = guard(requests, {"point": stands}, {}, image_of(now), state, rules)
        state = verdict.state
        for write in verdict.writes:
            if rule.slew is not None:
                allowed = rule.slew * (now - changed_at)
                assert abs(write.value - stands) <= allowed + 1e-6 * max(1.0, abs(stands))
            if taken:
                stands, changed_at = write.value, now


@given(rule=point_rules(), asked=ANY_FLOAT, wind=st.floats(15.1, 60.0), shown=ANY_FLOAT)
@settings(max_examples=200, deadline=None)
def test_an_engaged_interlock_holds_in_the_very_cycle_in_which_it_engages(rule, asked, wind, shown):
    verdict = guard(
        {"point": Request(asked, "plan")}, {"point": shown}, {}, image_of(0.0, wind_speed=wind), GuardState(),
        GuardRules({"point": rule}, (FORCE,)),
    )  # fmt: skip
    low, high = max(rule.low, min(3.0, rule.high)), min(rule.high, max(7.0, rule.low))
    for write in verdict.writes:
        assert low <= write.value <= high


@given(
    rule=point_rules(),
    asked=st.floats(-100.0, 200.0),
    times=st.lists(st.floats(0.0, 1000.0), max_size=20),
)
@settings(max_examples=200, deadline=None)
def test_every_change_of_a_request_leaves_a_row(rule, asked, times):
    """What is written differs from what was asked only together with a clamp that says so."""
    rules, state, now, shown = GuardRules({"point": rule}), GuardState(), 0.0, rule.safe
    for passed in times:
        now += passed
        verdict = guard({"point": Request(asked, "plan")}, {"point": shown}, {}, image_of(now), state, rules)
        state = verdict.state
        for write in verdict.writes:
            shown = write.value
            if write.value != asked:
                assert any(clamp.requested == asked and clamp.applied == write.value for clamp in verdict.clamps)
                assert write.reason


@given(
    grid=st.sampled_from([0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.5]),
    written=st.floats(12.0, 28.0),
    way=st.sampled_from([round, math.floor, math.ceil]),
)
@settings(max_examples=300, deadline=None)
def test_what_a_devices_resolution_makes_of_a_write_is_its_answer(grid, written, way):
    rule = PointRule(low=12.0, high=28.0, safe=18.0)
    shown = float(np.float32(grid * way(float(np.float32(written)) / grid)))
    assert rounds(rule, written, shown) or rule.same(written, shown)


@pytest.mark.parametrize(("written", "shown"), [(25.4, 25.3), (13.2, 13.15), (20.4, 20.3)])
def test_a_float_that_is_a_little_less_than_what_was_written_is_cut_off_a_whole_step(written, shown):
    assert rounds(PointRule(low=12.0, high=28.0, safe=18.0), written, shown)


@pytest.mark.parametrize("resolution", [1e-6, 0.1])
def test_a_whole_step_away_from_what_the_register_holds_is_no_answer(resolution):
    rule = PointRule(low=12.0, high=28.0, safe=18.0, resolution=resolution)
    assert not any(rounds(rule, 20.0, 20.0 + step) for step in (0.5, 0.25, 0.2, 0.1, -0.1, -0.2, -0.5))


@given(written=st.floats(12.0, 28.0), shown=st.floats(12.0, 28.0))
@settings(max_examples=300, deadline=None)
def test_nothing_further_away_than_the_coarsest_resolution_is_an_answer(written, shown):
    rule = PointRule(low=12.0, high=28.0, safe=18.0)
    if rounds(rule, written, shown):
        assert abs(written - shown) < 0.05 * 16.0


@given(
    before=st.floats(0.0, 100.0), steps=st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 300.0)), max_size=12)
)
@settings(max_examples=200, deadline=None)
def test_an_interlock_gives_a_point_that_nobody_asks_for_back_as_it_was(before, steps):
    """Whatever the wind does: once it is calm for good, the vent stands where it stood."""
    rule = PointRule(low=0.0, high=100.0, safe=0.0, minimum_interval=60.0, decided=False)
    wind = Interlock("wind", "wind_speed", {"vent": Bound(high=10.0)}, above=15.0, release=12.0)
    rules, state, now, stands = GuardRules({"vent": rule}, (wind,)), GuardState(), 0.0, before
    for speed, passed in [*steps, (0.0, 60.0), (0.0, 60.0)]:
        now += passed
        verdict = guard({}, {"vent": stands}, {}, image_of(now, wind_speed=speed), state, rules)
        state = verdict.state
        for write in verdict.writes:
            stands = write.value
            assert write.reason
        if speed > 15.0:
            assert stands <= 10.0
    assert stands == before


@given(
    rule=point_rules(),
    asked=ANY_FLOAT,
    shown=st.one_of(st.none(), ANY_FLOAT),
    wind=ANY_FLOAT,
    quality=QUALITIES,
    stopping=st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_nothing_is_written_while_somebody_operates_the_plc_by_hand(rule, asked, shown, wind, quality, stopping):
    image = Image(0.0, None, {"wind_speed": Value(wind, quality, 0.0)})
    rules, requests = GuardRules({"point": rule}, (FORCE,)), {"point": Request(asked, "plan")}
    verdict = guard(requests, {"point": shown}, {}, image, GuardState(), rules, stopping=stopping, manual=True)
    assert not verdict.writes
