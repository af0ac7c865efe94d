"""The actuation stage: what the PLC will do with setpoints, so that plans are made in setpoints.

A climate computer holds its setpoints with what the equipment can give. Lamps, screens and vents follow rules on
the weather and the measured climate. Heat and CO2 are what the balances of the coming step need to end at the
setpoint, between nothing and the capacity: so the costs of a plan follow from the energy and the CO2 that the
greenhouse really loses, and do not depend on how a PLC's controller happens to be tuned.

Every parameter is fitted to the site's own log. All functions are pure and elementwise, and work in numpy and
while an ONNX graph is traced (`xp`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

Array = Any
"""An array of the namespace `xp`, or a float."""
Values = Mapping[str, Array]


@dataclass(frozen=True)
class ActuationParameter:
    """One setting of the PLC or its equipment, as the simulator sees it."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    meaning: str


_ROWS = (
    ("heating_offset", "K", 0.0, -2.0, 2.0, "air above the heating setpoint while the PLC heats"),
    ("heating_capacity", "W m-2", 200.0, 10.0, 800.0, "most heat of the pipes"),
    ("heating_minimum", "W m-2", 0.0, 0.0, 80.0, "heat of the minimum pipe temperature"),
    ("grow_share", "1", 0.3, 0.0, 1.0, "excess of the grow pipe over that of the rail pipe"),
    ("ventilation_offset", "K", 2.0, -1.0, 10.0, "ventilation begins so far above the heating setpoint"),
    ("ventilation_band", "K", 6.0, 0.5, 30.0, "air temperature over which the vents open, at 15 degC outside"),
    ("ventilation_band_slope", "K K-1", 0.25, 0.0, 2.0, "how much wider it is for each degree colder outside"),
    ("wind_vent_delay", "1", 0.5, 0.0, 1.0, "opening of the lee vents at which the windward ones begin"),
    ("humidity_start", "%", 84.0, 60.0, 100.0, "humidity at which the vents open for moisture"),
    ("humidity_band", "%", 12.0, 2.0, 40.0, "humidity over which they open"),
    ("humidity_opening", "1", 0.35, 0.0, 1.0, "their largest opening for moisture"),
    ("wind_limit", "m s-1", 10.0, 4.0, 40.0, "wind at which the windward vents begin to close; 5 more shut them"),
    ("vent_following", "1", 0.5, 0.05, 1.0, "share of the way to their target that vents go in one step"),
    ("screen_radiation", "W m-2", 40.0, 0.0, 400.0, "global radiation above which the energy screen opens"),
    ("screen_outdoor", "degC", 12.0, -20.0, 40.0, "outdoor temperature above which the energy screen stays open"),
    ("screen_closure", "%", 97.0, 0.0, 100.0, "closure of the closed energy screen"),
    ("blackout_closure", "%", 0.0, 0.0, 100.0, "closure of the blackout screen while lamps burn in the dark"),
    ("blackout_night", "%", 0.0, 0.0, 100.0, "its closure in the dark without lamps"),
    ("lamp_installed", "W m-2", 81.0, 0.0, 500.0, "electric power of the lamps"),
    ("lamp_radiation_limit", "W m-2", 400.0, 0.0, 1500.0, "global radiation above which the PLC puts the lamps off"),
    ("co2_capacity", "kg m-2 h-1", 0.015, 0.0, 0.1, "most CO2 dosed"),
    ("co2_offset", "ppm", -20.0, -300.0, 300.0, "air above the CO2 setpoint while the PLC doses"),
    ("irrigation_rate", "L m-2 h-1", 1.5, 0.0, 20.0, "irrigation while it is asked for, mean over its pulses"),
    ("co2_vent_stop", "1", 0.5, 0.02, 2.0, "mean vent opening at which dosing has stopped"),
)

PARAMETERS: Mapping[str, ActuationParameter] = MappingProxyType({row[0]: ActuationParameter(*row) for row in _ROWS})
"""Every parameter of the stage by its name."""

READ_CLIMATE = ("air_temperature", "air_humidity")
"""What the rules for the vents read, as the sensors show it."""
MEMORY = ("vent_lee", "vent_wind")
"""Positions, %, that the stage carries from step to step."""


def set_equipment(
    xp: Any, setpoints: Values, weather: Values, climate: Values, memory: Values, parameters: Values
) -> dict[str, Array]:
    """Return lamps (W m-2), screens and vents (%) of the coming step.

    Args:
        xp: the array namespace.
        setpoints: `heating_setpoint` (degC) and `lamp_on` (0 to 1).
        weather: `global_radiation`, `outdoor_temperature`, `wind_speed`.
        climate: `READ_CLIMATE`, measured.
        memory: `MEMORY`, the positions now.
        parameters: by name.
    """
    radiation, outdoor = weather["global_radiation"], weather["outdoor_temperature"]
    lamp = setpoints["lamp_on"] * _below(xp, radiation, parameters["lamp_radiation_limit"], 50.0)
    dark = _below(xp, radiation, 10.0, 5.0)
    screen = (
        parameters["screen_closure"]
        * _below(xp, radiation, parameters["screen_radiation"], 20.0)
        * _below(xp, outdoor, parameters["screen_outdoor"], 1.0)
    )
    blackout = dark * (lamp * parameters["blackout_closure"] + (1.0 - lamp) * parameters["blackout_night"])

    wind = weather["wind_speed"]
    calm = _ramp(xp, (parameters["wind_limit"] + 5.0 - wind) / 5.0)
    start = setpoints["heating_setpoint"] + parameters["ventilation_offset"]
    cold = xp.maximum(15.0 - outdoor, 0.0 * outdoor)
    band = parameters["ventilation_band"] + parameters["ventilation_band_slope"] * cold
    wish = _ramp(xp, (climate["air_temperature"] - start) / band)
    damp = parameters["humidity_opening"] * _ramp(
        xp, (climate["air_humidity"] - parameters["humidity_start"]) / parameters["humidity_band"]
    )
    wish = xp.maximum(wish, damp)
    delay = parameters["wind_vent_delay"]
    share = parameters["vent_following"]
    lee = 100.0 * wish * (0.5 + 0.5 * calm)
    windward = 100.0 * _ramp(xp, (wish - delay) / (1.001 - delay)) * calm
    return {
        "lamp_power": lamp * parameters["lamp_installed"],
        "energy_screen": screen,
        "blackout_screen": blackout,
        "vent_lee": memory["vent_lee"] + share * (lee - memory["vent_lee"]),
        "vent_wind": memory["vent_wind"] + share * (windward - memory["vent_wind"]),
    }


def heat_to_hold(
    xp: Any,
    heating_setpoint: Array,
    air_temperature: Array,
    balance: tuple[Array, Array, Array],
    parameters: Values,
    seconds: Array,
) -> Array:
    """Return the heat of the pipes in W m-2 that ends the step at the setpoint, between minimum and capacity.

    Args:
        xp: the array namespace.
        heating_setpoint: degC.
        air_temperature: degC as the PLC's sensor shows it.
        balance: (flux, conductance, capacity) of the air's heat without the pipes (`hybrid.climate.balances`).
        parameters: by name.
        seconds: length of the step.
    """
    target = heating_setpoint + parameters["heating_offset"]
    needed = _flux_to_reach(xp, target - air_temperature, balance, seconds)
    return xp.minimum(xp.maximum(needed, parameters["heating_minimum"]), parameters["heating_capacity"])


def co2_to_hold(
    xp: Any,
    missing: Array,
    balance: tuple[Array, Array, Array],
    vents: Array,
    parameters: Values,
    seconds: Array,
) -> Array:
    """Return the CO2 dosing in kg m-2 h-1 that ends the step at the setpoint, within the capacity.

    Args:
        xp: the array namespace.
        missing: kg m-3 that the air lacks to the setpoint (with its offset).
        balance: (flux, conductance, capacity) of the air's CO2 without dosing.
        vents: mean opening of the vents, 0 to 1.
        parameters: by name.
        seconds: length of the step.
    """
    stop = parameters["co2_vent_stop"]
    allowed = parameters["co2_capacity"] * _ramp(xp, 1.25 * (stop - vents) / stop)
    needed = 3600.0 * _flux_to_reach(xp, missing, balance, seconds)
    return xp.minimum(xp.maximum(needed, 0.0 * needed), allowed)


def _flux_to_reach(xp: Any, difference: Array, balance: tuple[Array, Array, Array], seconds: Array) -> Array:
    """Return the further flux that changes a state by `difference` over the step (see `climate.relax`)."""
    flux, conductance, capacity = balance
    return difference * conductance / (1.0 - xp.exp(-seconds * conductance / capacity)) - flux


def _ramp(xp: Any, value: Array) -> Array:
    """Return the value cut to 0 ... 1."""
    zero = 0.0 * value
    return xp.minimum(xp.maximum(value, zero), zero + 1.0)


def _below(xp: Any, value: Array, limit: Array, width: float) -> Array:
    """Return 1 well below a limit, 0 well above it, one half at it."""
    return 0.5 - 0.5 * xp.tanh((value - limit) / width)
