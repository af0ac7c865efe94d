"""One cause after the other: what joins those before it, and what takes their place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from igrow.core.bundle import Estimate
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.design.candidates import Candidate, Pattern
from igrow.trainer.diagnosis.design.linear import Term
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.diagnosis.search import cross_validation, history, rounds
from igrow.trainer.diagnosis.search.change import Round
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.search.scan import Hypothesis
from tests.diagnosis.synthetic_design import Truth
from tests.diagnosis.test_cross_validation import change_of
from tests.diagnosis.test_parameter_change import with_parameters


def of(effect: str, amplitude: float = 1.0) -> Estimated:
    hypothesis = Hypothesis(Candidate(effect, ()), Term(0), 40.0, amplitude, 5.0, 0.001)
    size = Estimate.about(amplitude, 0.1, "1")
    return Estimated(hypothesis, ActiveTerm(effect, amplitude, {}), size, 40.0, None, (effect,))


def effects(causes: Sequence[Estimated]) -> list[str]:
    return [one.effect for one in causes]


@pytest.mark.parametrize(
    ("sizes", "joined"),
    [
        # Size and standard error of the first and of the new one, beside each other.
        ([(0.1, 0.01), (0.1, 0.02)], ["rain_cooling", "lamp_heat"]),
        ([(0.1, 0.02), (0.1, 0.01)], ["lamp_heat"]),
        # Beside the new one nothing is left of the first.
        ([(0.0, 0.02), (0.1, 0.01)], ["lamp_heat"]),
        # The new one adds nothing of its own, or neither has a size.
        ([(0.1, 0.01), (0.0, 0.02)], []),
        ([(0.1, 0.09), (0.1, 0.11)], []),
        ([(0.1, 0.01), (0.1, 0.06)], []),
        # It only mops up what is left, up to its bound.
        ([(0.1, 0.01), (1e9, 1e9)], []),
    ],
)
def test_a_later_cause_that_is_more_surely_there_takes_the_place_of_those_before_it(
    sizes: list[tuple[float, float]], joined: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A humidity sensor by 15 % off was first told as an air sensor: a search is linear, and a refit is not."""
    search, judged = searched(sizes, monkeypatch)
    first, new, led = of("rain_cooling"), of("lamp_heat"), set[str]()
    assert effects(search.joined_by(new, judged, [first], led)) == joined
    assert led == ({"rain_cooling"} if joined == ["lamp_heat"] else set())


def test_what_gave_way_does_not_lead_again(monkeypatch: pytest.MonkeyPatch) -> None:
    search, judged = searched([(0.1, 0.02), (0.1, 0.01)], monkeypatch)
    back = search.joined_by(of("rain_cooling"), judged, [of("lamp_heat")], {"rain_cooling"})
    assert effects(back) == ["lamp_heat", "rain_cooling"]


def test_beside_one_that_adds_nothing_another_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a pipe's sensor that is off, lamps that heat more were all that was asked: a crop at night went untold."""
    search, judged = searched([(0.1, 0.01), (0.1, 0.06)], monkeypatch)
    asked: list[frozenset[str]] = []

    def judge(one: rounds.Search, _design: Any, found: Sequence[Estimated], *_rest: Any, **_causes: Any) -> Any:
        asked.append(one.without)
        rest = [name for name in ("rain_cooling", "lamp_heat", "night_transpiration") if name not in one.without]
        return replace(judged, patterns=cast(Any, tuple(rest[len(found) : len(found) + 1])))

    monkeypatch.setattr(rounds.Search, "judge", judge)
    monkeypatch.setattr(rounds.Search, "design", lambda *_asked: judged.design)
    monkeypatch.setattr(rounds, "estimate", lambda one, _rng: of(*one.patterns) if one.patterns else None)
    monkeypatch.setattr(
        rounds.Search,
        "joined_by",
        lambda _one, new, _round, found, _led: [] if new.effect == "lamp_heat" else [*found, new],
    )
    _, _, found = search.run(np.random.default_rng(0))
    assert effects(found) == ["rain_cooling", "night_transpiration"]
    assert asked == [frozenset(), frozenset(), frozenset({"lamp_heat"}), frozenset({"lamp_heat"})]


def test_beside_what_no_cause_explains_causes_are_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A greenhouse unlike its calibration (CO2 at dawn, in spring) hid a CO2 sensor that was off by 120 ppm."""
    search, judged = searched([(0.1, 0.01)], monkeypatch)
    dawn, dusk = (
        replace(of("").hypothesis, cause=Pattern("co2", when, ("hour",))) for when in ("06 to 08 h", "18 to 20 h")
    )
    rounds_told: list[Round] = []

    def judge(one: rounds.Search, _design: Any, found: Sequence[Estimated], *_rest: Any, **_causes: Any) -> Round:
        rest = [pattern for pattern in (dawn, dusk) if pattern not in one.unnamed]
        named = replace(judged, cause=cast(Any, "co2_offset" if not (rest or found) else None))
        rounds_told.append(replace(named, patterns=tuple(rest[:1])))
        assert one.is_unlike == bool(one.unnamed)
        return rounds_told[-1]

    monkeypatch.setattr(rounds.Search, "judge", judge)
    monkeypatch.setattr(rounds.Search, "design", lambda *_asked: judged.design)
    monkeypatch.setattr(rounds, "estimate", lambda one, _rng: of(one.cause) if one.cause else None)
    monkeypatch.setattr(rounds.Search, "joined_by", lambda _one, new, _round, found, _led: [*found, new])
    first, last, found = search.run(np.random.default_rng(0))
    assert (first, effects(found), last.patterns) == (rounds_told[0], ["co2_offset"], (dawn, dusk))
    assert len(rounds_told) == 4


def test_where_much_is_unexplained_a_change_must_gain_far_more(monkeypatch: pytest.MonkeyPatch) -> None:
    search, _ = searched([(0.1, 0.01)], monkeypatch)
    asked: list[tuple[float, set[str]]] = []

    def expected(_known: Any, laid_out: Any, _misfit: Any, _without: Any, gains: Any, unnamed: set[str]) -> Any:
        asked.append((gains.least, unnamed))
        return laid_out

    monkeypatch.setattr(history, "expected", expected)
    dawn = replace(of("").hypothesis, cause=Pattern("co2", "06 to 08 h", ("hour",)))
    beside = search.beside([dawn])
    assert beside is not None and search.beside([]) is None
    search.design(()), beside.design(())
    assert asked == [(8.0, set()), (8.0 * DEFAULT.far_over_null, {"co2:06 to 08 h"})]


def test_beside_the_last_pattern_no_further_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    search, judged = searched([(0.1, 0.01)], monkeypatch)
    asked: list[bool] = []
    monkeypatch.setattr(cross_validation, "find", lambda *_: None)

    def changed(*_: Any, patterns: bool, **__: Any) -> Round:
        asked.append(patterns)
        return judged

    monkeypatch.setattr(rounds, "changed", changed)
    for count in range(DEFAULT.most_patterns + 1):
        unnamed = (of("").hypothesis,) * count
        replace(search, unnamed=unnamed, is_unlike=bool(count)).judge(
            judged.design, [], np.random.default_rng(0), causes=True
        )
    assert asked == [True] * DEFAULT.most_patterns + [False]


def searched(sizes: Sequence[tuple[float, float]], monkeypatch: pytest.MonkeyPatch) -> tuple[rounds.Search, Round]:
    """Return a search whose refit gives two causes these sizes and standard errors, and one alone the new one's."""
    design = with_parameters(Truth({}, {}), 1)

    def refitted(_search: Any, _judged: Any, causes: Sequence[Estimated]) -> list[Estimated]:
        found = []
        for one, (size, error) in zip(causes, sizes[-len(causes) :], strict=True):
            found.append(replace(one, term=replace(one.term, amplitude=size), certainty=size / error))
        return found

    monkeypatch.setattr(rounds.Search, "refitted", refitted)
    return change_of(design), Round(design, cast(Any, None), cast(Any, None), None, ())
