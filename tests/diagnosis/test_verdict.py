"""What a log is called where something has a name and something else is unexplained."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from igrow.trainer.diagnosis import DEFAULT, diagnose
from igrow.trainer.diagnosis.answer import wording

MODULE = cast(Any, sys.modules[diagnose.__module__])
SINCE = cast(Any, SimpleNamespace(time=np.datetime64("2020-03-08")))


@pytest.mark.parametrize(
    ("effect", "onset", "pattern", "verdict"),
    [
        ("humidity_offset", None, True, "named"),
        ("lamp_heat", SINCE, True, "named"),
        # A warm neighbour was told as a floor that stores heat, beside a pattern that gained more.
        ("soil_heat_storage", None, True, "unexplained"),
        ("soil_heat_storage", None, False, "named"),
        ("", None, True, "unexplained"),
        ("", None, False, "nothing"),
    ],
)
def test_a_process_that_was_there_all_along_may_be_a_part_of_what_is_unexplained(
    effect: str, onset: Any, pattern: bool, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wording, "finding", lambda one: SimpleNamespace(effect=one.effect, confounded=(one.effect,)))
    monkeypatch.setattr(wording, "discrepancy", lambda *_: SimpleNamespace(effect="discrepancy", confounded=()))
    kept = (SimpleNamespace(effect=effect, onset=onset, certainty=9.0),) if effect else ()
    completed, result = SimpleNamespace(found=()), SimpleNamespace(kept=kept, parameter=None)
    told, findings = MODULE._verdict(completed, result, ("a pattern",) if pattern else (), DEFAULT)
    assert told == verdict
    assert [one.effect for one in findings] == [effect] * bool(effect) + ["discrepancy"] * pattern
