"""Every cause of the catalogue is asked once a season, beginning on a day, beside a log with nothing in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.diagnosis.cases import hidden
from benchmarks.diagnosis.catalogue import BEGINS, TIMES, cases, draw, line, rows
from benchmarks.diagnosis.scoring import Outcome
from igrow.core.effects import EFFECTS

START = np.datetime64("2020-01-20T00:00:00")
TYPICAL = {name: effect.amplitude.typical for name, effect in EFFECTS.items()}


def outcome(cause: str, *found: str, corrected: float = 1.2) -> Outcome:
    (case,) = [one for one in cases("winter", "one") if one.causes == ((cause,) if cause else ())]
    right = found[:1] == (cause,)
    return Outcome(
        case, "named" if found else "nothing", found, (found,) if found else (),
        relative_size=1.2 if right else None, relative_flux=None, covered=None, half_width=None,
        onset_error=0.5 if right else None, deployed=3.0, recalibrated=2.0, corrected=corrected, perfect=1.0,
        expected_gain=None, known_gain=None, seconds=1.0,
    )  # fmt: skip


def test_every_cause_begins_once_a_season_twice_as_large_as_a_clearly_visible_one() -> None:
    first, *others = cases("winter", "one")
    assert first.causes == ()
    assert [one.causes for one in others] == [(name,) for name in EFFECTS]
    assert len({one.seed for one in (first, *others)}) == 1 + len(others)
    for one in others:
        (effect,) = hidden(one, TYPICAL, START)
        assert effect.start == START + np.timedelta64(BEGINS, "D")
        assert effect.size == min(TIMES * TYPICAL[effect.name], EFFECTS[effect.name].amplitude.high)


def test_the_table_counts_names_sizes_beginnings_and_what_was_gained(tmp_path: Path) -> None:
    outcomes = [
        outcome(""),
        outcome("screen_gap", "screen_gap"),
        outcome("lamp_heat", "pipe_lag", corrected=2.0),
        replace(outcome("co2_offset", corrected=2.0), recalibrated=1.05, corrected=1.05),
    ]
    found = {what: (figure, count) for what, figure, count in rows(outcomes)}
    assert found["right cause first"] == (1 / 3, 3)
    assert found["the same, where recalibration errs a tenth more"] == (0.5, 2)
    assert found["right, where a name is given"] == (0.5, 2)
    assert found["another name beside a right one"] == (0.0, 1)
    assert found["beginning within 2 days, where found"] == (1.0, 1)
    assert np.allclose(found["size, median relative error"], (0.2, 1))
    assert np.allclose(found["recoverable error recovered"], (0.8 / 2.05, 3))
    assert [line(one).split()[:2] for one in outcomes[:2]] == [["nothing", "nothing"], ["screen_gap", "screen_gap"]]
    draw(tmp_path / "one.svg", {"winter": outcomes})
    assert "<svg" in (tmp_path / "one.svg").read_text()
