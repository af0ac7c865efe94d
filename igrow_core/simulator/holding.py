"""How the PLC's two fast loops end a planning step: heat and CO2 that hold their setpoints.

A planning step of half an hour is longer than the loops of pipe and dosing take to settle, so that their rules
(`actuation`) cannot be stepped through at that pace. What they achieve can: they hold the setpoint with what the
equipment can give. So the heat and the CO2 of a step are those that the balances need to end it at the setpoint,
between a minimum and a capacity, and the costs of a plan follow from what the greenhouse really loses.

Pure and elementwise, in numpy and while an ONNX graph is traced (`xp`).
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Values
from igrow.core.simulator.actuation import Rule

_ROWS = (
    ("heating_offset", "K", 0.0, -3.0, 3.0, "air above the heating setpoint while the PLC heats"),
    ("heating_capacity", "W m-2", 200.0, 5.0, 1000.0, "most heat of the pipes"),
    ("heating_minimum", "W m-2", 0.0, 0.0, 80.0, "heat of the minimum pipe temperature"),
    ("grow_share", "1", 0.3, 0.0, 1.5, "excess of the grow pipe over that of the rail pipe"),
    ("co2_offset", "ppm", -20.0, -400.0, 400.0, "air above the CO2 setpoint while the PLC doses"),
    ("co2_capacity", "kg m-2 h-1", 0.015, 0.0, 0.1, "most CO2 dosed"),
    ("co2_vent_stop", "1", 0.5, 0.02, 2.0, "mean vent opening at which dosing has stopped"),
)

PARAMETERS: Mapping[str, Rule] = MappingProxyType({row[0]: Rule(*row) for row in _ROWS})
"""Every parameter by its name."""


def heat_to_hold(
    xp: Any,
    heating_setpoint: Array,
    air_temperature: Array,
    flux: Array,
    answer: Array,
    parameters: Values,
) -> Array:
    """Return the heat of the pipes in W m-2 that ends the step at the setpoint, between minimum and capacity.

    Args:
        xp: the array namespace.
        heating_setpoint: degC.
        air_temperature: degC as the PLC's sensor shows it.
        flux: what moves the temperature without the pipes, W m-2.
        answer: of the temperature to a flux over the step, K per W m-2 (`hybrid.exponential.heat_and_vapour`).
        parameters: `PARAMETERS` by name.
    """
    target = heating_setpoint + parameters["heating_offset"]
    needed = (target - air_temperature) / answer - flux
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
        parameters: `PARAMETERS` by name.
        seconds: length of the step.
    """
    stop = parameters["co2_vent_stop"]
    share = 1.25 * (stop - vents) / stop
    zero = 0.0 * share
    allowed = parameters["co2_capacity"] * xp.minimum(xp.maximum(share, zero), zero + 1.0)
    flux, conductance, capacity = balance
    needed = 3600.0 * (missing * conductance / (1.0 - xp.exp(-seconds * conductance / capacity)) - flux)
    return xp.minimum(xp.maximum(needed, 0.0 * needed), allowed)
