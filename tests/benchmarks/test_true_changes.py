"""A parameter that is told to have changed is judged by what the plant's own has done."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.diagnosis.scoring import true_changes
from igrow.core.bundle import Estimate
from igrow.core.greenhouse import GreenhouseParameters
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.answer.result import Finding
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange

BEFORE = GreenhouseParameters()


def told(parameter: str, share: float) -> Finding:
    """Return the finding of a parameter."""
    size = Estimate(share, share - 0.1, share + 0.1, "1")
    return wording.parameter(ParameterChange(parameter, size, None, 0.001, (parameter,), leads=True))


@pytest.mark.parametrize(
    ("parameter", "share", "true"),
    [
        ("transmissivity", 0.2, True),
        ("transmissivity", -0.2, False),
        ("rail_pipe_heat_transfer", 0.2, False),
        ("transpiration_moist_air", 0.2, False),
    ],
)
def test_a_change_is_true_where_the_plants_own_is_large_and_in_the_direction_told(
    parameter: str, share: float, *, true: bool
) -> None:
    now = replace(BEFORE, cover_transmission=1.26 * BEFORE.cover_transmission)
    assert true_changes([told(parameter, share)], BEFORE, now) == ((parameter,) if true else ())


def test_a_small_change_is_none() -> None:
    now = replace(BEFORE, cover_transmission=1.06 * BEFORE.cover_transmission)
    assert true_changes([told("transmissivity", 0.2)], BEFORE, now) == ()
