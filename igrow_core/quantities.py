"""The one registry of quantities: name, unit, valid range, meaning.

Configuration, logs, networks, reports and the status page all read a quantity here, so that one thing has
one name and one unit everywhere. Times are UTC; a fraction is 0 to 1, an opening or closure 0 to 100 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType


class Kind(Enum):
    """What part a quantity plays in the loop."""

    WEATHER = "weather"
    CLIMATE = "climate"
    GROWTH = "growth"
    YIELD = "yield"
    SETPOINT = "setpoint"
    ACTUATOR = "actuator"
    MARK = "mark"
    """Written by the gateway itself: no register has it."""


@dataclass(frozen=True)
class Quantity:
    """One measured, simulated or commanded quantity."""

    name: str
    unit: str
    low: float
    """Smallest value a working sensor or a sane command can have."""
    high: float
    """Largest value a working sensor or a sane command can have."""
    kind: Kind
    meaning: str
    optional: bool = False
    """A site that lacks it loses nothing but that knowledge (all actuators are optional too)."""

    def holds(self, value: float) -> bool:
        """Tell whether `value` lies in the valid range (NaN does not)."""
        return self.low <= value <= self.high

    @property
    def difference_unit(self) -> str:
        """Unit of an error or a difference: kelvin for a temperature, which units of elsewhere convert without 32."""
        return "K" if self.unit == "degC" else self.unit


def _quantity_table() -> Mapping[str, Quantity]:
    def rows(kind: Kind, *table: tuple[str, str, float, float, str], optional: bool = False) -> list[Quantity]:
        return [Quantity(name, unit, low, high, kind, meaning, optional) for name, unit, low, high, meaning in table]

    quantities = [
        *rows(
            Kind.WEATHER,
            ("outdoor_temperature", "degC", -50.0, 60.0, "air temperature outside"),
            ("outdoor_humidity", "%", 0.0, 100.0, "relative humidity outside"),
            ("outdoor_co2", "ppm", 200.0, 1500.0, "carbon dioxide outside"),
            ("global_radiation", "W m-2", -20.0, 1500.0, "short-wave radiation on a horizontal plane outside"),
            ("wind_speed", "m s-1", 0.0, 60.0, "wind speed outside"),
            ("sky_temperature", "degC", -90.0, 60.0, "black-body temperature of the sky"),
        ),
        *rows(
            Kind.WEATHER,
            ("wind_direction", "deg", 0.0, 360.0, "direction the wind blows from, clockwise from north"),
            ("rain", "1", 0.0, 1.0, "fraction of the time it rained"),
            optional=True,
        ),
        *rows(
            Kind.CLIMATE,
            ("air_temperature", "degC", -20.0, 60.0, "greenhouse air temperature"),
            ("air_humidity", "%", 0.0, 100.0, "greenhouse relative humidity"),
            ("air_co2", "ppm", 150.0, 5000.0, "greenhouse carbon dioxide"),
            ("par", "umol m-2 s-1", 0.0, 3000.0, "photosynthetically active radiation above the crop"),
        ),
        *rows(
            Kind.GROWTH,
            ("leaf_area_index", "m2 m-2", 0.0, 10.0, "leaf area per floor area"),
            ("plant_load", "fruits m-2", 0.0, 3000.0, "growing fruits per floor area"),
            ("net_growth", "kg m-2", 0.0, 100.0, "cumulative net growth, dry matter"),
        ),
        *rows(
            Kind.YIELD,
            ("fruit_fresh_weight", "kg m-2", 0.0, 150.0, "cumulative harvested fresh weight"),
        ),
        *rows(
            Kind.SETPOINT,
            ("heating_setpoint", "degC", 5.0, 35.0, "air temperature below which the PLC heats"),
            ("co2_setpoint", "ppm", 300.0, 2000.0, "carbon dioxide below which the PLC doses"),
            ("lamp_on", "1", 0.0, 1.0, "fraction of the time the lamps are asked to burn"),
            ("irrigation_on", "1", 0.0, 1.0, "fraction of the time irrigation is asked to run"),
        ),
        *rows(
            Kind.SETPOINT,
            ("humidity_setpoint", "%", 50.0, 100.0, "relative humidity above which the PLC opens its vents"),
            ("ventilation_setpoint", "degC", 5.0, 45.0, "air temperature above which the PLC opens its vents"),
            (
                "minimum_pipe_setpoint",
                "degC",
                0.0,
                90.0,
                "temperature below which the PLC never lets the pipe rail fall",
            ),
            ("energy_screen_setpoint", "%", 0.0, 100.0, "largest closure of the energy screen, 0 keeps it open"),
            optional=True,
        ),
        *rows(
            Kind.ACTUATOR,
            ("rail_pipe_temperature", "degC", 0.0, 110.0, "temperature of the pipe rail"),
            ("grow_pipe_temperature", "degC", 0.0, 110.0, "temperature of the grow pipe"),
            ("vent_lee", "%", 0.0, 100.0, "opening of the vents on the lee side"),
            ("vent_wind", "%", 0.0, 100.0, "opening of the vents on the wind side"),
            ("energy_screen", "%", 0.0, 100.0, "closure of the energy screen, 100 is closed"),
            ("blackout_screen", "%", 0.0, 100.0, "closure of the blackout screen, 100 is closed"),
            ("lamp_power", "W m-2", 0.0, 500.0, "electric power of the lamps per floor area"),
            ("co2_dosing", "kg m-2 h-1", 0.0, 0.1, "carbon dioxide dosed per floor area"),
            ("irrigation", "L m-2 h-1", 0.0, 60.0, "irrigation water per floor area"),
            optional=True,
        ),
        *rows(
            Kind.MARK,
            ("separating_test", "1", 0.0, 1.0, "fraction of the time that a separating test moved the plant"),
            optional=True,
        ),
    ]
    return MappingProxyType({quantity.name: quantity for quantity in quantities})


QUANTITIES: Mapping[str, Quantity] = _quantity_table()
"""Every quantity by its name, in the registry's order."""


def with_unit(name: str, value: float, form: str = "g") -> str:
    """Return a value as the daemon's sentences name it: "28 degC", "65 %"; fractions in per cent.

    Whoever shows such a sentence finds the unit in it, and tells the value in the units of the site. A point that is no
    quantity, such as an alarm of the PLC, has a bare number.

    Args:
        name: of a quantity or a point.
        value: in the registry's unit.
        form: as `format` has it, of the number.
    """
    return number_with_unit(value, QUANTITIES[name].unit if name in QUANTITIES else "", form)


def difference_with_unit(name: str, value: float, form: str = "g") -> str:
    """Return an error or a difference of a quantity, as `with_unit` does a value: "4 K" of a temperature."""
    return number_with_unit(value, QUANTITIES[name].difference_unit if name in QUANTITIES else "", form)


def number_with_unit(value: float, unit: str, form: str = "g") -> str:
    """Return a number in a unit as sentences name it; a fraction in per cent."""
    if unit == "1":
        return f"{100.0 * value:{form}} %"
    return f"{value:{form}} {unit}".rstrip()


def names(kind: Kind) -> tuple[str, ...]:
    """Return the names of all quantities of one kind, in the registry's order."""
    return tuple(quantity.name for quantity in QUANTITIES.values() if quantity.kind is kind)


WEATHER = names(Kind.WEATHER)
CLIMATE = names(Kind.CLIMATE)
GROWTH = names(Kind.GROWTH)
YIELD = names(Kind.YIELD)
SETPOINTS = names(Kind.SETPOINT)
USUAL_SETPOINTS = tuple(name for name in SETPOINTS if not QUANTITIES[name].optional)
"""Those of every site that does not say otherwise; a site names the others itself."""
ACTUATORS = names(Kind.ACTUATOR)
