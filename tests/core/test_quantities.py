"""A value in a sentence has the unit of its quantity, and so can be told in the units of a site."""

from __future__ import annotations

import pytest

from igrow.core.language import speak
from igrow.core.quantities import QUANTITIES, difference_with_unit, with_unit


@pytest.mark.parametrize(
    ("name", "value", "told", "american"),
    [
        ("heating_setpoint", 28.0, "28 degC", "82.4 °F"),
        ("air_co2", 1200.0, "1200 ppm", "1,200 ppm"),
        ("vent_lee", 12.5, "12.5 %", "12.5 %"),
        ("lamp_on", 0.5, "50 %", "50 %"),
        ("wind_speed", 4.1, "4.1 m s-1", "9.171 mph"),
        ("wind_alarm", 1.0, "1", "1"),
    ],
)
def test_a_value_is_told_with_its_unit(name: str, value: float, told: str, american: str) -> None:
    assert with_unit(name, value) == told
    assert speak("en", units="us").values(told) == american


def test_a_difference_of_temperatures_is_one_in_kelvin() -> None:
    assert difference_with_unit("air_temperature", 4.0) == "4 K"
    assert speak("en", units="us").values("4 K") == "7.2 °F"


@pytest.mark.parametrize("name", QUANTITIES)
def test_every_unit_of_the_registry_is_found_again_in_a_sentence(name: str) -> None:
    """None is left as the registry writes it, a number without one part of its unit behind it."""
    told = speak("de").values(with_unit(name, 2.5))
    unit = speak("de").shown(QUANTITIES[name].unit).unit
    assert told == (f"2,5 {unit}" if unit else "250 %")
