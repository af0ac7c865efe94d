"""What begins within a log is judged by the days before it, whatever else goes on all along."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from igrow.trainer.diagnosis.design import linear
from igrow.trainer.diagnosis.design.design import Design
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.search import change
from igrow.trainer.diagnosis.search.scan import Hypothesis
from tests.diagnosis.synthetic_design import Truth
from tests.diagnosis.test_parameter_change import with_parameters


def of(truth: Truth, *, own: Mapping[str, float] | None = None, **needed: float) -> Design:
    """A design of a greenhouse with gains of its own and bounds of others."""
    design = with_parameters(truth, 1)
    assert design.history is not None
    largest = {name.replace("__", ":"): gain for name, gain in needed.items()}
    return replace(design, history=replace(design.history, own_gains=own or {}, null_gains=NullGains(largest, 8.0)))


def scored(design: Design) -> list[Hypothesis]:
    return change.scored(design, linear.fit(design.grams, design.null_model()), np.random.default_rng(0))


def told(design: Design) -> tuple[str, int | None]:
    """Return which effect is chosen, and its first day; nothing where it gains less than it must."""
    found = change.chosen(design, scored(design))
    assert found is not None
    return (found.effect, found.term.onset) if change.over_null(design, found) >= 1.0 else ("", None)


@pytest.mark.parametrize(("onset", "named"), [(16, ("lamp_heat", 16)), (0, ("", None))])
def test_what_a_house_wanders_by_from_month_to_month_hides_no_beginning(
    onset: int, named: tuple[str, int | None]
) -> None:
    """A sensor 1.5 K off since the eighth day gained 24 nats, and this house's windows had gained 28: all was taken."""
    assert told(of(Truth({"lamp_heat": 0.8}, {}, onset=onset), own={"lamp_heat": 1e3})) == named


def test_what_others_gain_all_along_hides_no_beginning() -> None:
    hidden = of(Truth({"lamp_heat": 0.8}, {}, onset=16), lamp_heat=1e3)
    assert told(hidden) == ("lamp_heat", 16)
    assert told(of(Truth({"lamp_heat": 0.8}, {}, onset=16), lamp_heat=1e3, beginning__lamp_heat=1e3)) == ("", None)


def test_a_beginning_is_told_though_another_gains_more_but_too_little_all_along() -> None:
    """Lamps that gave more since the eighth day gained 33 nats, and a misfit of spring 46 that must be 72."""
    design = of(Truth({"lamp_heat": 0.8}, {}, onset=16), rain_cooling=1e3)
    column = design.columns("effect:rain_cooling")[0]
    design.values[0] -= 0.7 * design.values[column]
    design = design.whitened(design.whitening)
    first = max(scored(design), key=lambda one: change.net_gain(design, one))
    assert (first.effect, first.always) == ("rain_cooling", None)
    assert told(design) == ("lamp_heat", 16)


def test_beside_what_is_unexplained_a_process_that_was_there_all_along_is_not_asked() -> None:
    """A warm neighbour was told as a floor that stores heat, once a pattern had taken the most of it."""
    design = with_parameters(Truth({"lamp_heat": 0.8}, {}), 1)
    assert design.history is not None
    beside = replace(design, history=replace(design.history, unnamed=frozenset({"heat:cold weather"})))
    assert {one.effect for one in scored(design)} >= {"lamp_heat"}
    assert all(one.always is not None for one in scored(beside))
    begun = with_parameters(Truth({"lamp_heat": 0.8}, {}, onset=16), 1)
    assert begun.history is not None
    begun = replace(begun, history=replace(begun.history, unnamed=frozenset({"heat:cold weather"})))
    assert [(one.effect, one.term.onset) for one in scored(begun)] == [("lamp_heat", 16)]
