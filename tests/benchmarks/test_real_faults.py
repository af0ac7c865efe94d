"""What the benchmark of faults in real logs does to a log, and how it judges what is told of it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.diagnosis.real_faults import FAULTS, Case, Told, rows
from igrow.core.effects import EFFECTS
from tests.virtual_log import virtual_log


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_changes_what_it_says_from_its_day_on(name: str) -> None:
    table, fault = virtual_log(2, step=300.0), FAULTS[name]
    on = (np.arange(len(table)) >= len(table) // 2).astype(np.float64)
    assert not fault.cause or fault.cause in EFFECTS
    for quantity, values in fault.columns(table, on).items():
        assert np.shape(values) == (len(table),)
        assert np.isfinite(values).all()
        if fault.within:
            np.testing.assert_array_equal(values[on == 0.0], table[quantity][on == 0.0])
    changed = fault.columns(table, np.ones(len(table)))
    assert any(not np.array_equal(values, table[quantity]) for quantity, values in changed.items())


def told(fault: str, *names: str, verdict: str = "named", error: float = 1.0) -> Told:
    errors = {"air_humidity": {"deployed": 9.0, "recalibrated": error, "corrected": 1.0}}
    return Told("a house", fault, verdict, names, None, None, None, errors)


def test_a_name_is_judged_by_whether_the_fault_matters_and_has_a_cause() -> None:
    plain = told("", verdict="nothing")
    cases = [
        Case(told("humidity sensor -8 %", "humidity_offset", error=2.0), plain),
        Case(told("humidity sensor -8 %", "lamp_heat"), plain),
        Case(told("anemometer at two fifths", "wind_infiltration"), plain),
        Case(told("pipe sensors -5 K", "discrepancy", verdict="unexplained"), plain),
    ]
    found = {what: (figure, count) for what, figure, count in rows(cases)}
    assert found["right first, where an error rises by a fifth"] == (1.0, 1)
    assert found["right first, where none does"] == (0.0, 2)
    assert found["right, where a name is given"] == (0.5, 2)
    assert found["share of such an error that a right name removes"] == (0.5, 1)
    assert found["no cause of the catalogue: a name all the same"] == (1.0, 1)
