"""What a change must gain: more than where nothing has changed, each place judged by the others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from benchmarks.diagnosis import null_gains as learning
from benchmarks.diagnosis import null_skills as skills
from benchmarks.diagnosis.null_gains import Gained
from benchmarks.diagnosis.null_skills import Told
from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.design.candidates import CHANNELS
from igrow.trainer.diagnosis.learned.null_gains import (
    BEGINNING_PREFIX,
    PATTERN_SKILLS_FILE,
    SKILLS_FILE,
    NullGains,
    read_null_gains,
    read_null_pattern_skills,
    read_null_skills,
    read_unknown_gains,
)


def test_a_change_must_gain_more_than_it_did_where_nothing_had_changed() -> None:
    known = NullGains({"co2_drift": 20.0, "lamp_heat": 1.0}, least=9.0)
    assert known.needed("co2_drift") == 20.0
    assert known.needed("lamp_heat") == known.needed("rain_cooling") == 9.0


def test_a_skill_is_judged_by_the_others_too_and_by_its_own_effect() -> None:
    found = [
        (51.0, {"lamp_heat": 0.0402}),
        (51.0, {"lamp_heat": 0.02}),
        (52.0, {"lamp_heat": 0.03, "rain_cooling": 0.02}),
        (52.0, {"rain_cooling": -0.01}),
        (53.0, {}),
    ]
    assert skills.of_each([one for _, one in found]) == {"lamp_heat": 0.0402, "rain_cooling": 0.02}
    # The other place's 0.03 would have let it pass; the second's was no more than what the first one lost.
    assert skills.least_skill(found, 0.02) == 0.041
    assert skills.least_skill(found[1:], 0.02) == 0.031
    # Of fifty logs one may be told.
    fifty = [*found, (54.0, {"screen_gap": 0.06}), *[(55.0, {})] * 44]
    assert skills.least_skill(fifty, 0.02) == 0.041
    assert skills.least_skill(fifty, 0.01) == 0.061
    known = read_null_skills()
    assert all(known.needed(name) >= known.least > 0.01 for name in EFFECTS)
    assert set(known.largest) <= set(EFFECTS)


def test_patterns_have_bounds_of_their_own_by_kind() -> None:
    found = [
        Told(51.0, "one", "nothing", {"lamp_heat": 0.03}, {"heat": 0.05, "weekly": 0.01}),
        Told(52.0, "two", "noise", {"lamp_heat": 0.02}, {"heat": 0.02}),
    ]
    learned = skills.learned(found, {}, false_causes=0.02, false_patterns=0.0)
    of_effects, of_patterns = learned[SKILLS_FILE], learned[PATTERN_SKILLS_FILE]
    assert (of_effects.largest, of_effects.least) == ({"lamp_heat": 0.03}, 0.031)
    assert (of_patterns.largest, of_patterns.least) == ({"heat": 0.05, "weekly": 0.01}, 0.051)
    # What may be told differs.
    assert skills.learned(found, {}, false_causes=0.5, false_patterns=0.0)[SKILLS_FILE].least == 0.001
    assert set(read_null_pattern_skills().largest) <= {*CHANNELS, "weekly"}


def test_what_came_with_the_trainer_knows_effects_and_parameters() -> None:
    known = read_null_gains()
    assert known.least >= learning.LEAST
    effects = (name.removeprefix(BEGINNING_PREFIX) for name in known.largest if not name.startswith("parameter:"))
    assert set(effects) <= set(EFFECTS)
    assert "parameter:transmissivity" in known.largest
    assert any(name.startswith(BEGINNING_PREFIX) for name in known.largest)


def test_of_an_unknown_greenhouse_more_is_asked_and_of_effects_alone() -> None:
    unknown, known = read_unknown_gains(), read_null_gains()
    assert sum(map(unknown.needed, EFFECTS)) > sum(map(known.needed, EFFECTS))
    assert {name.removeprefix(BEGINNING_PREFIX) for name in unknown.largest} <= set(EFFECTS)


@pytest.mark.parametrize("largest", [9, 23, 60, 61])
def test_every_change_must_gain_the_least_with_which_no_such_log_is_named(
    largest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where even the most that is tried names something, the logs are to be looked at: no bound is made up."""
    found = [Gained(51.0, "one", {"lamp_heat": float(largest) - 0.5}, {}, {})]
    monkeypatch.setattr(learning, "named", lambda _job: ("lamp_heat",))
    jobs, logs = cast(Any, SimpleNamespace(each=map)), cast(Any, [None])
    if largest > learning.MOST:
        with pytest.raises(SystemExit, match="are given a name still"):
            learning.least_gain(jobs, logs, found, may=0)
    else:
        assert learning.least_gain(jobs, logs, found, may=0) == largest
        assert learning.least_gain(jobs, logs, found, may=1) == learning.LEAST


def test_a_place_is_judged_by_the_gains_of_the_others() -> None:
    found = [
        Gained(51.0, "one", {"co2_drift": 30.0, "lamp_heat": 2.0}, {"lamp_heat": 20.0}, {}),
        Gained(51.0, "its neighbour", {"co2_drift": 12.0}, {}, {}),
        Gained(52.0, "two", {"lamp_heat": 10.0, "co2_drift": 9.0}, {"lamp_heat": 5.0}, {}),
    ]
    alone = learning.of_others(found, 51.0, 8.0)
    assert alone.largest == {"lamp_heat": 10.0, "co2_drift": 9.0, "beginning:lamp_heat": 5.0}
    assert all(learning.is_asked(one, learning.of_others(found, one.place, 8.0)) for one in found)
    # What gains less than a change must at least is not asked, nor what the others have gained too.
    assert not learning.is_asked(found[1], learning.of_others(found, 51.0, 13.0))
    every = learning.of_others(found, 0.0, 8.0)
    assert not learning.is_asked(Gained(53.0, "three", {"co2_drift": 29.0}, {}, {}), every)
    # What begins within a log has a bound of its own, first or not.
    for gain, asked in ((19.0, False), (21.0, True)):
        one = Gained(53.0, "three", {"co2_drift": 29.0}, {"lamp_heat": gain}, {})
        assert learning.is_asked(one, every) == asked
