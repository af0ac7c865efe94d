from __future__ import annotations

from igrow.core.effects import EFFECTS
from igrow.trainer.diagnosis.activation import ActiveTerm
from igrow.trainer.diagnosis.candidates import Candidate
from igrow.trainer.diagnosis.estimate import Estimated, within_bounds
from igrow.trainer.diagnosis.gram import Term
from igrow.trainer.diagnosis.result import Interval
from igrow.trainer.diagnosis.selection import Hypothesis

BOUNDS = EFFECTS["co2_valve_leak"].amplitude


def leak(size: float) -> Estimated:
    cause = Hypothesis(Candidate("co2_valve_leak", ()), Term(0), 40.0, size, 5.0, 0.001)
    term = ActiveTerm("co2_valve_leak", size, {}, None)
    return Estimated(cause, term, Interval(size, size - 0.5, size + 0.5, BOUNDS.unit), 40.0, None, ("co2_valve_leak",))


def test_a_size_beyond_its_bound_is_brought_back_and_its_interval_reaches_it() -> None:
    one = within_bounds(leak(1.4 * BOUNDS.high))
    assert one.term.amplitude == one.amplitude.value == one.amplitude.low == BOUNDS.high
    assert one.amplitude.high == 1.4 * BOUNDS.high + 0.5


def test_a_size_within_its_bounds_stays() -> None:
    assert within_bounds(leak(0.5 * BOUNDS.high)) == leak(0.5 * BOUNDS.high)
