"""What unseen days refuse is searched for no more, and what was found beside it is asked by itself."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.validation import correction
from igrow.trainer.diagnosis.validation.correction import Corrected, correct
from tests.diagnosis.test_rounds import effects, of

MODULE = sys.modules["igrow.trainer.diagnosis.diagnose"]  # its function has its name


@dataclass(frozen=True)
class Rounds:
    """A search that finds the first two effects that it may."""

    asked: list[frozenset[str]]
    names: tuple[str, ...]
    without: frozenset[str] = frozenset()

    @property
    def site(self) -> Any:
        return SimpleNamespace(longitude=5.0)

    def run(self, _rng: np.random.Generator, _earlier: Sequence[Estimated]) -> tuple[Any, Any, list[Estimated]]:
        self.asked.append(self.without)
        begun = SimpleNamespace(design=SimpleNamespace(line=None), number=len(self.asked), patterns=())
        return begun, begun, [of(name) for name in self.names if name not in self.without][:2]


def searched(
    names: Sequence[str], proven: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> tuple[list[frozenset[str]], int, list[str], list[str]]:
    """Return what each search left out, the number of the round told as the first, what was found last, and kept."""

    def judged(*arguments: Any) -> Corrected:
        found = arguments[2]
        kept = tuple(one for one in found if one.effect in proven)
        # What was found beside a first that does not stand is asked only where it gains enough by itself.
        refused = frozenset(one.effect for one in found[:1] if one.effect not in proven)
        return Corrected({}, () if refused else kept, unproven=refused)

    monkeypatch.setattr(MODULE, "correct", judged)
    monkeypatch.setattr(MODULE, "hidden_by_missing_weather", lambda _line: ())
    around = SimpleNamespace(completed=SimpleNamespace(days=None), knowledge=None, rules=DEFAULT, new_crop=False)
    question = SimpleNamespace(progress=lambda _line: None)
    asked: list[frozenset[str]] = []
    first, _, found, result = MODULE._Question._borne_out(
        cast(Any, question), cast(Any, around), cast(Any, Rounds(asked, tuple(names))), np.random.default_rng(0), []
    )
    return asked, first.number, effects(found), effects(result.kept)


def test_what_was_found_beside_a_refused_cause_is_asked_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A humidity sensor's drift in a real log went with a play of the vents that unseen days refused."""
    asked, first, found, kept = searched(("vent_backlash", "humidity_drift"), ("humidity_drift",), monkeypatch)
    assert asked == [frozenset(), frozenset({"vent_backlash"})]
    assert found == kept == ["humidity_drift"]
    assert first == 1


def test_what_stands_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, _, found, kept = searched(("lamp_heat", "humidity_drift"), ("lamp_heat",), monkeypatch)
    assert asked == [frozenset()]
    assert found == ["lamp_heat", "humidity_drift"]
    assert kept == ["lamp_heat"]


def test_no_more_searches_are_made_than_a_log_may_have_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, _, _, kept = searched(("lamp_heat", "screen_gap", "sky_cooling", "pipe_lag"), (), monkeypatch)
    assert [len(names) for names in asked] == [0, 1, 2]
    assert kept == []


def test_a_correction_says_which_causes_unseen_days_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was skipped, for it gained too little beside what did not stand, was not refused."""
    monkeypatch.setattr(correction, "_tried", lambda *_: None)
    days = SimpleNamespace(fit=lambda *_: None)
    knowledge = SimpleNamespace(prior=None, terms=(), posterior=None)
    causes = [of("vent_backlash"), of("humidity_drift")]
    result = correct(cast(Any, days), cast(Any, knowledge), causes, (), 5.0, DEFAULT)
    assert result.unproven == {"vent_backlash"}
    assert result.kept == ()
