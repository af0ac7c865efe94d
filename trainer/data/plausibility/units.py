"""Units that a column cannot have, by the size of its values alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.quantities import QUANTITIES
from igrow.core.telemetry import Telemetry
from igrow.trainer.data.fault import DataFault, Remedy

TEMPERATURES = ("air_temperature", "outdoor_temperature", "sky_temperature", "heating_setpoint")
PIPES = ("rail_pipe_temperature", "grow_pipe_temperature")
SHARES = ("air_humidity", "outdoor_humidity")
POSITIONS = ("vent_lee", "vent_wind", "energy_screen", "blackout_screen")
CARBON = ("air_co2", "co2_setpoint", "outdoor_co2")

HOTTEST_MEDIAN = 42.0
"""degC: no greenhouse and no place on earth has a higher median."""
LEAST_VALUES = 24

DRIEST = 0.5
"""Of a relative humidity from 0 to 1: the median of no greenhouse is less."""

RELATIVE_IN_PER_CENT = "take the column of relative humidity in %, not g m-3 or kPa"
FAHRENHEIT = Remedy(5.0 / 9.0, -160.0 / 9.0)
_KELVIN = Remedy(1.0, -273.15)


def readings(telemetry: Telemetry, name: str) -> Floats:
    """Return what was read of a quantity, (k,); nothing of one that the log lacks."""
    values = telemetry.columns.get(name, np.empty(0))
    return values[np.isfinite(values)]


def wrong_units(telemetry: Telemetry) -> list[DataFault]:
    """Return the columns whose values are of another unit than the registry's."""
    checks: Mapping[tuple[str, ...], Callable[[str, Floats], DataFault | None]] = {
        TEMPERATURES: _temperature,
        PIPES: _pipe,
        SHARES: _humidity,
        POSITIONS: _position,
        CARBON: _carbon_dioxide,
        ("wind_speed",): _wind,
        ("co2_dosing",): _dose,
        ("lamp_power",): _power,
        ("lamp_on", "irrigation_on", "rain"): _switch,
    }
    read = [(name, check, readings(telemetry, name)) for names, check in checks.items() for name in names]
    faults = (check(name, values) for name, check, values in read if len(values) >= LEAST_VALUES)
    found = [fault for fault in faults if fault is not None]
    hardly = _hardly_opens(readings(telemetry, "vent_lee"), readings(telemetry, "vent_wind"))
    return [one for one in found if not (hardly and one.quantity == "vent_wind")]


def _hardly_opens(lee: Floats, wind: Floats) -> bool:
    """Tell whether windward vents are in % though they stay below 1: as a fraction they would open first."""
    return len(lee) >= LEAST_VALUES and len(wind) > 0 and 1.001 < float(lee.max()) < 100.0 * float(wind.max())


def changed(name: str, remedy: Remedy) -> str:
    """Return the mend of a column of which scale and offset alone are wrong."""
    return f"in the mapping: {name}: {{column: ..., scale: {remedy.scale:.7g}, offset: {remedy.offset:.7g}}}"


def in_another_unit(kind: str, name: str, seen: str, remedy: Remedy) -> DataFault:
    """Return the fault of a column of which scale and offset alone are wrong, for certain."""
    return DataFault(kind, name, seen, changed(name, remedy), remedy)


def _temperature(name: str, values: Floats) -> DataFault | None:
    low, middle, high = (float(one) for one in np.quantile(values, (0.05, 0.5, 0.95)))
    seen = f"{name} has a median of {middle:.4g}"
    if low > 233.0 and high < 333.0 and high - low < 70.0:
        return in_another_unit("kelvin", name, f"{seen}, so it is in kelvin", _KELVIN)
    if middle <= HOTTEST_MEDIAN:
        return None
    if high < 140.0:
        return in_another_unit("fahrenheit", name, f"{seen}, so it is in degF", FAHRENHEIT)
    if high < 600.0:
        return in_another_unit("tenths", name, f"{seen}, so it is in tenths of degC", Remedy(0.1))
    return DataFault("no_temperature", name, f"{seen} and is no temperature", "name its column anew (--column)")


def _pipe(name: str, values: Floats) -> DataFault | None:
    warm = values[values > 1.0]
    if len(warm) < LEAST_VALUES:
        return None
    low, high = (float(one) for one in np.quantile(warm, (0.02, 0.98)))
    if low > 270.0 and high < 383.0:
        return in_another_unit("kelvin", name, f"{name} lies above {low:.0f}, so it is in kelvin", _KELVIN)
    # A pipe at rest is as warm as its greenhouse: never below 50 in degF, hardly above 40 in degC.
    if low > 48.0 and 100.0 < high < 240.0:
        seen = f"{name} lies between {low:.0f} and {high:.0f}, so it is in degF"
        return in_another_unit("fahrenheit", name, seen, FAHRENHEIT)
    return None


def _humidity(name: str, values: Floats) -> DataFault | None:
    middle, high = (float(one) for one in np.quantile(values, (0.5, 0.995)))
    if middle > 100.5 and high <= 1005.0:
        return in_another_unit(
            "tenths", name, f"{name} has a median of {middle:.4g}, so it is in tenths of %", Remedy(0.1)
        )
    # A deficit in kPa lies there too, and is small where the air is damp.
    if high <= 1.05 and middle > (DRIEST if name == "air_humidity" else 0.1):
        seen = f"{name} lies between 0 and 1 (median {middle:.2f}), so it is a fraction"
        return in_another_unit("fraction", name, seen, Remedy(100.0))
    if name == "air_humidity" and middle < 25.0 and high < 45.0:
        seen = f"{name} has a median of {middle:.3g} and hardly exceeds {high:.3g}: no greenhouse is so dry"
        return DataFault("absolute_humidity", name, seen, RELATIVE_IN_PER_CENT)
    return None


def _position(name: str, values: Floats) -> DataFault | None:
    top = float(values.max())
    between = np.unique(np.round(values[(values > 0.02) & (values < 0.98)], 4))
    # Percentages below 1 all along, in steps finer than any actuator has.
    if 0.3 < top <= 1.001 and (len(between) >= 15 or (values > 0.9).mean() > 0.05):
        seen = f"{name} never exceeds {top:.2g}, so it is a fraction"
        return in_another_unit("fraction", name, seen, Remedy(100.0))
    return None


def _carbon_dioxide(name: str, values: Floats) -> DataFault | None:
    middle = float(np.median(values))
    if 0.02 < middle < 0.6:
        return in_another_unit("percent", name, f"{name} has a median of {middle:.3g}, so it is in %", Remedy(1e4))
    return None


def _wind(name: str, values: Floats) -> DataFault | None:
    middle, high = (float(one) for one in np.quantile(values, (0.5, 0.99)))
    if middle > 14.0 or high > 27.0:
        metres = Remedy(1.0 / 3.6)
        seen = f"{name} has a median of {middle:.3g} and a highest of {high:.3g}, so it is no m s-1; taken for km/h"
        mend = f"{changed(name, metres)}; scale: 0.44704 for mph, 0.514444 for knots"
        return DataFault("kilometres_per_hour", name, seen, mend, metres)
    return None


def _dose(name: str, values: Floats) -> DataFault | None:
    """Judge the rate while something is dosed; hardly anybody doses less than 10 or more than 400 kg ha-1 h-1."""
    dosed = values[values > 0.0]
    if len(dosed) < LEAST_VALUES or float(np.median(dosed)) <= QUANTITIES[name].high:
        return None
    middle = float(np.median(dosed))
    possible = {
        unit: scale
        for unit, scale in (("kg ha-1 h-1", 1e-4), ("g m-2 h-1", 1e-3))
        if 10.0 <= middle * scale * 1e4 <= 400.0
    }
    seen = f"{name} has a median of {middle:.3g} while it doses, more than any greenhouse in kg m-2 h-1"
    if not possible:
        return DataFault("dose", name, seen, "give its scale in the mapping")
    mend = " or ".join(
        f"in {unit}, then {{amount: {Remedy().amount}, scale: {scale:g}}}" for unit, scale in possible.items()
    )
    only = Remedy(next(iter(possible.values()))) if len(possible) == 1 else None
    return DataFault("dose", name, seen, f"it is {mend} in the mapping", only)


def _power(name: str, values: Floats) -> DataFault | None:
    top = float(values.max())
    if 0.0 < top <= 1.001:
        seen = f"{name} never exceeds {top:.2g}, so it tells whether lamps burn, not their W m-2"
        return DataFault("fraction", name, seen, "take it as lamp_on, or give the lamps' W m-2 as its scale")
    return None


def _switch(name: str, values: Floats) -> DataFault | None:
    top = float(values.max())
    if 1.5 < top <= 100.5 and (values > 1.5).mean() > 0.01:
        return in_another_unit("percent", name, f"{name} reaches {top:.3g}, so it is in %", Remedy(0.01))
    return None
