"""Which names of a diagnosis count as right."""

from __future__ import annotations

import pytest

from benchmarks.diagnosis.naming import is_named, is_same


@pytest.mark.parametrize(
    ("name", "cause", "right"),
    [
        ("stack_ventilation", "stack_ventilation", True),
        ("vent_stack", "stack_ventilation", True),
        ("soil_respiration", "co2_valve_leak", True),
        ("lamp_radiation_share", "stack_ventilation", False),
        ("stack_ventilation", "vent_stack", False),
        ("leakage_still", "open_door", False),
    ],
)
def test_a_cause_has_its_own_name_its_twins_and_that_of_what_no_log_tells_apart(
    name: str, cause: str, right: bool
) -> None:
    assert is_same(name, cause) is right


def test_a_cause_is_named_wherever_its_name_stands() -> None:
    assert is_named("wind_infiltration", ("humidity_offset", "leakage_wind"))
    assert not is_named("wind_infiltration", ("humidity_offset",))
    assert not is_named("wind_infiltration", ())
