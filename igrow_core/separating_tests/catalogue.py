"""The separating tests there are; `python -m benchmarks.diagnosis separating` prints what each brings."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

from igrow.core.separating_tests.definition import Condition, SeparatingTest, Stage

CALM_NIGHT = (
    Condition("wind_speed", high=8.0, margin=3.0),
    Condition("outdoor_temperature", low=0.0, margin=2.0),
    Condition("rain", high=0.1, if_measured=True),
)
"""Vents that stand open at night need air that is neither a storm nor frost, and no rain."""

VENT_SQUARE_WAVE = SeparatingTest(
    name="vent_square_wave",
    separates=("vent_backlash", "wind_infiltration", "stack_ventilation"),
    title="vents that turn back every half hour of a calm night",
    course=tuple(Stage(30.0, {"vent_lee": opening}) for opening in (15.0, 5.0) * 4),
    when="night",
    conditions=CALM_NIGHT,
)

VENT_OPENING = SeparatingTest(
    name="vent_opening",
    separates=("co2_offset", "co2_drift", "co2_valve_leak", "soil_respiration", "humidity_offset", "humidity_drift"),
    title="vents that stand open for two hours of a calm night",
    course=(Stage(120.0, {"vent_lee": 30.0}),),
    when="night",
    conditions=CALM_NIGHT,
)
DOSING_PAUSE = SeparatingTest(
    name="dosing_pause",
    separates=("co2_offset", "co2_drift", "co2_dose_vent_loss", "photosynthesis_decline"),
    title="two hours without CO2 about noon",
    course=(Stage(120.0, {"co2_setpoint": 400.0}),),
    when="day",
    conditions=(),
)

SEPARATING_TESTS: Mapping[str, SeparatingTest] = MappingProxyType(
    {one.name: one for one in (VENT_SQUARE_WAVE, VENT_OPENING, DOSING_PAUSE)}
)


def separating_tests_for(effects: Collection[str]) -> tuple[SeparatingTest, ...]:
    """Return the tests that would tell one of several effects from the others; none for a single effect."""
    if len(set(effects)) < 2:
        return ()
    return tuple(one for one in SEPARATING_TESTS.values() if set(one.separates) & set(effects))
